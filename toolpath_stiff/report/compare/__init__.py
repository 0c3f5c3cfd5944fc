"""The results of a comparison with measurements: page, files and text."""
