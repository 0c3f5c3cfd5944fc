"""Many programs: one page and one table over all."""
