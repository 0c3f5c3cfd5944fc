"""The colours of pictures, and of the scale of stiffness on pages."""

import numpy as np

INK, MUTED, GRID = "#1f2933", "#616e7c", "#e4e7eb"
SLATE, GREY, RED, ORANGE = "#52606d", "#9aa5b1", "#d64545", "#de6b12"
BLUE, LIGHT_BLUE, GREEN, PURPLE, PALE_RED = "#2457a6", "#7ea6d8", "#2f855a", "#7b4fa0", "#f7d9dd"
CHOSEN, WITHIN, FAINT = "#e3edfa", "#e9edf2", "#b8c1cc"  # behind what is chosen; within bounds; lines that only guide
NOWHERE = "#eceff3"  # out of reach, on a map
STIFFNESS, RESIDUAL = "viridis", "RdBu"  # scales; red: measured softer than modelled, blue: stiffer
ERROR = "RdYlBu_r"  # of a surface; red: material left, blue: cut too deep
DIRECTIONS = {"X": BLUE, "Y": ORANGE, "Z": GREEN, "oblique": PURPLE}  # of a reading
CLASSES = 32  # colours; more cannot be told apart along a line, and each costs a drawing call


def error_colours() -> list[str]:
    """The classes' colours of an error of the surface, from cut too deep to material left."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(c) for c in colormaps[ERROR](np.linspace(0.06, 0.94, CLASSES))]


def page_colours() -> dict[str, list[str]]:
    """The classes' colours for the script of a page, weakest first, on light and on dark."""
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    # The lightest yellow does not show on white, nor the darkest violet on black.
    ends = {"colours": (0.0, 0.93), "colours_dark": (0.22, 1.0)}
    return {name: [to_hex(c) for c in colormaps[STIFFNESS](np.linspace(*end, CLASSES))] for name, end in ends.items()}
