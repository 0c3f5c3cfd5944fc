"""The page and pictures of an update."""
