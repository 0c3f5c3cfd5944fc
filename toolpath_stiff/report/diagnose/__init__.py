"""The results of a diagnosis: page, its section on what the missing thing looks like, and files."""
