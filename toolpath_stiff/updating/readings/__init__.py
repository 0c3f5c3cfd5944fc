"""Measured stiffnesses: files, rows, raw records of force and displacement."""
