"""The command line: thin, arguments to calls and results to files."""
