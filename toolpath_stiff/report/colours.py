"""Colours of pictures; those of pages are in their scripts."""

INK, MUTED, GRID = "#1f2933", "#616e7c", "#e4e7eb"
SLATE, GREY, RED, ORANGE = "#52606d", "#9aa5b1", "#d64545", "#de6b12"
BLUE, LIGHT_BLUE, GREEN, PURPLE, PALE_RED = "#2457a6", "#7ea6d8", "#2f855a", "#7b4fa0", "#f7d9dd"
CHOSEN, WITHIN, FAINT = "#e3edfa", "#e9edf2", "#b8c1cc"  # background of the chosen; within bounds; guide lines
NOWHERE = "#eceff3"  # out of reach, on a map
STIFFNESS, RESIDUAL = "viridis", "RdBu"  # scales; red: measured softer than modelled, blue: stiffer
ERROR = "RdYlBu_r"  # of a surface; red: material left, blue: cut too deep
DIRECTIONS = {"X": BLUE, "Y": ORANGE, "Z": GREEN, "oblique": PURPLE}  # of a reading
CLASSES = 32  # colours; more cannot be told apart along a line, and each costs a drawing call
