"""Shared by all long-running work: worker processes, finished parts, progress, atomic files, seal files."""
