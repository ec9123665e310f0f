"""Replay of bags through the estimator, and comparison of bags."""
