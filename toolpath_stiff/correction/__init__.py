"""Correction of a machine: effects added and fitted, judged by readings that they have not seen."""
