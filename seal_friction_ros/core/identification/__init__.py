"""Friction readings, candidate laws, fits, and their diagnostics."""
