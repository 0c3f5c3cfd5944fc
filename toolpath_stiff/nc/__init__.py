"""NC program text to moves; knows no machine."""
