"""The feed-forward tuned on a simulated or a recorded axis."""
