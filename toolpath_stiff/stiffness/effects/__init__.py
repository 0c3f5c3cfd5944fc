"""Physical effects along the load path, one flat file each."""
