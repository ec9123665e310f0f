"""Runs of the contact computations: lubricated contact and finite-element O-ring."""
