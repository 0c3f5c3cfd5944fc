"""Stiffness of the tool tip: the exact route, the closed form, physical effects."""
