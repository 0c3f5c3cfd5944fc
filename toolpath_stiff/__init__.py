"""Stiffness of a hexapod (Stewart-platform) mill along a real NC program."""

__version__ = "0.1.0"
