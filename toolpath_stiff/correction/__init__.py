"""Effects added to a machine and fitted, judged by readings that they have not seen."""
