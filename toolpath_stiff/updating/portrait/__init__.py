"""A portrait of what is missing where no effect of the catalogue explains the readings."""
