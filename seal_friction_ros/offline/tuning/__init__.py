"""The feed-forward tuned, from files to files."""
