"""Processor time of one core: imported before numpy, this keeps the libraries of linear algebra to one thread."""

import os
import time

for _library in ('OPENBLAS', 'MKL', 'OMP'):
    os.environ[f'{_library}_NUM_THREADS'] = '1'

processor_time = time.process_time
"""[s] of this process"""
