"""The live estimate and feed-forward: records, messages, and one function for each message."""
