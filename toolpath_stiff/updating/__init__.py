"""Measurements against the model: what the data say of machine and effects."""
