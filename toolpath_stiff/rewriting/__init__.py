"""A program transformed: written for another placement, or its placement as offsets; knows no stiffness."""

from toolpath_stiff.rewriting.offset_blocks import OffsetBlocks, offset_blocks
from toolpath_stiff.rewriting.program import Rewritten, check_decimals, check_rewritable, rewrite_program

__all__ = ["OffsetBlocks", "Rewritten", "check_decimals", "check_rewritable", "offset_blocks", "rewrite_program"]
