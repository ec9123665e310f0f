"""Property tests draw the same examples every time, so a run is reproducible."""

from hypothesis import settings

settings.register_profile('reproducible', derandomize=True, deadline=None, database=None)
settings.load_profile('reproducible')
