"""Blind simulator of a measuring campaign on a machine that hides something; here a blind exercise as a folder."""
