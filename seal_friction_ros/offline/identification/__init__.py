"""Identification of a friction law from measurements: sources -> readings -> fitted law -> seal file."""
