"""A case: one folder with machine versions, data, results and the steps taken, which can be undone."""
