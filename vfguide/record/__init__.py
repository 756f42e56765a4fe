"""The flight record: what every vehicle really did, in one file."""
