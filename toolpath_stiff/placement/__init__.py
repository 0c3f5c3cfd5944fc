"""Where the work should sit: the search, the front, the placement chosen and what is said about it."""
