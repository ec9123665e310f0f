"""The estimator inside other programs: C generated from its functions, and FMUs."""
