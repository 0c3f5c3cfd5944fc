"""The codes: one file a group, each with its functions and their rows in the table (`registry`)."""
