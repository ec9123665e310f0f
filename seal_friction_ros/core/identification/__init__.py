"""Friction readings, the ladder of laws, fits and what they are worth."""
