"""The codes: what a code is, in which modal group it stands, and when in its block it acts."""
