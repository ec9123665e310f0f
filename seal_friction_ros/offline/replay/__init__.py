"""A bag through the estimator, and two bags compared."""
