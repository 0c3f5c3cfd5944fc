"""Description of what no effect of the catalogue explains: its link, its direction, its variable."""
