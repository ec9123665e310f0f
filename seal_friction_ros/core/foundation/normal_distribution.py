"""Constants of the normal distribution."""

BAND_95 = 1.959964
"""Half the width of the interval about the mean that holds 95 % of a normal distribution [standard deviations]."""
