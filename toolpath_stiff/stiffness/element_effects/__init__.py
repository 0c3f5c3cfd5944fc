"""Effects on elements of the load path, for machines described by elements; one flat file each."""
