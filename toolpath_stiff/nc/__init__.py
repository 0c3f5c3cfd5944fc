"""NC program text to moves; knows no machine."""

from toolpath_stiff.nc.moves import MOTION_NAMES, Moves, Program, ToolUse, Unsupported
from toolpath_stiff.nc.reader import parse_program, read_program

__all__ = ["MOTION_NAMES", "Moves", "Program", "ToolUse", "Unsupported", "parse_program", "read_program"]
