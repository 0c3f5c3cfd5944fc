"""Moves placed on a machine, sampled to poses, and as a table."""
