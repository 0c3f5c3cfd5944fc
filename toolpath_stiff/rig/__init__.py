"""Blind simulator of a measuring campaign on a machine that hides something; shares no code with the model."""
