"""NC programs and cutter-location files, from file or text, to `Program`, whose moves know no machine."""
