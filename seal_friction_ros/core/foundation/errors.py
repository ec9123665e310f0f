"""What an iteration raises that found no solution: an error, never a number."""


class NotConvergedError(ValueError):
    """No solution was found; the message says where, and how far it came."""
