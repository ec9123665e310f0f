"""Commands of the studies; `seal_friction` finds them by name."""
