"""Cutting forces and their effect on the part: stock, engagement, forces, surface error."""
