"""Stiffness of the tool tip: the plain reference, the exact production route, physical effects."""
