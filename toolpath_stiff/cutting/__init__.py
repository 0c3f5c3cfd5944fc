"""Cutting forces and what they make of the part: stock, engagement, forces, the error of a surface."""
