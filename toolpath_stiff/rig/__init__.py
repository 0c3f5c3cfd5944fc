"""Blind simulator of a measuring campaign on a machine that hides something; shares nothing with the stack."""
