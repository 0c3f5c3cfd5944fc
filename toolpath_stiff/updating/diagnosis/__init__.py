"""Which physical effect is missing, in figures and words."""
