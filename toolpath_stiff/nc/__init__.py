"""NC programs and cutter-location files, read from file or text to `Program`, whose moves depend on no machine."""
