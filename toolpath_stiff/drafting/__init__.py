"""A portrait as the source text of an effect file."""
