"""Placements of the work: the search, the front, the placement chosen, and advice on it."""
