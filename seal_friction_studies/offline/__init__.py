"""Runs, comparisons with bags, and pages of the studies."""
