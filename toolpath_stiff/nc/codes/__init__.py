"""Codes: what a code is, its modal group, and its place in the order of execution."""
