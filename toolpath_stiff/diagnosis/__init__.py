"""Diagnosis of the missing physical effect: the verdict that all noise models share, and its grounds."""
