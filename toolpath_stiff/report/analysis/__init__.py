"""The results of one analysis: files and text."""
