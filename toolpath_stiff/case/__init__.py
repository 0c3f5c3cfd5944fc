"""A case: machine versions, data and steps with undo in one folder, and what was found out on it."""
