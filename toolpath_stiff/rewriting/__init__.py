"""A program transformed: written for another placement, or its placement as offsets; knows no stiffness."""

from toolpath_stiff.rewriting.program import (
    OffsetBlocks,
    Rewritten,
    check_decimals,
    check_rewritable,
    offset_blocks,
    rewrite_program,
)

__all__ = ["OffsetBlocks", "Rewritten", "check_decimals", "check_rewritable", "offset_blocks", "rewrite_program"]
