"""The page, pictures and set-up sheet of a placement."""
