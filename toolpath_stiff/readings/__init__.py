"""Measured stiffnesses: tables and raw records to readings in columns, struts over time."""
