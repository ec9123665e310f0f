"""Parameters, units, arrays, compilation: what every other room stands on."""
