"""Pages with figures and numbers."""
