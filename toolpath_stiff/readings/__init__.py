"""Measured stiffnesses: tables and raw records as readings in columns, struts over time."""
