"""The command line, a thin layer: arguments become calls, results become files."""
