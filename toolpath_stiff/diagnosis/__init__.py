"""Which physical effect is missing: the verdict that all noise models share, and what stands behind it."""
