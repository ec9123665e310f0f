"""Friction of the seals of an actuator: geometry, laws, states."""
