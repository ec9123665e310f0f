"""Contact of a seal, computed from case files: O-ring by finite elements, and lubricated contact."""
