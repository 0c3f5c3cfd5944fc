"""What no effect of the catalogue explains, described: which link, which direction, what it varies with."""
