"""Effects on elements of the load path, for machines that are described by these; one flat file each."""
