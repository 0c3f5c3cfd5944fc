"""Options shared by several functions, and checks of argument values: mm, degrees and N."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from toolpath_stiff.analysis.turning import BEST, FEED, FIXED
from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.program import Program
from toolpath_stiff.options import Option, number_in, numbers
from toolpath_stiff.poses import Pose, pose_in_si

FARTHEST_MM = 1e5  # 100 m: no machine is larger; more is a mistaken unit or key
FARTHEST_DEG = 360.0


def turn_of(word: str) -> str | float:
    """One of the words `fixed`, `feed`, `best`, or degrees. Raises `ValueError`."""
    try:
        return word if word in (FIXED, FEED, BEST) else float(word)
    except ValueError:
        raise ValueError(f"{FIXED}, {FEED}, {BEST}, or degrees") from None


# Options shared by several functions.
Step = Annotated[float, Option("--step", "mm", above=0, at_most=1000)]
Force = Annotated[float, Option("--force", "N", above=0, at_most=1e6)]
LoadDirection = Annotated[str, Option("--load", "DIRECTION")]
Origin = Annotated[Sequence[float] | None, Option("--origin", "X,Y,Z[,A,B,C]", read=numbers)]
Turn = Annotated[str | float, Option("--turn", "fixed|feed|best|DEG", read=turn_of)]
# Coarser than 0.01 mm is not machining; beyond nine decimals a double has no more digits.
Decimals = Annotated[int | None, Option("--decimals", at_least=2, at_most=9)]
Linearised = Annotated[float | None, Option("--linearise", "mm", above=0, at_most=10)]


def template(file: str) -> str:
    """The text of a packaged template."""
    return (Path(__file__).parents[1] / "data" / "templates" / f"{file}.txt").read_text("utf-8")


def read_at(part: Program, origin: Pose | None, default: Pose) -> tuple[ReadProgram, Pose]:
    """A program as read for a zero, and where that then is."""
    first = part.moves(origin, default)
    return first, origin or (first.origin if first.origin_source == "program" else default)


def finite(name: str, value: Any) -> float:
    """A number, neither infinite nor nan, from a command, a call or a page. Raises `InputError`."""
    number = number_in(value)
    if not math.isfinite(number):
        raise InputError(f"{name} {str(value)[:40]!r}".strip(), expected="a finite number")
    return number


def pose_si(name: str, pose: Sequence[float]) -> Pose:
    """X, Y, Z or X, Y, Z, A, B, C in mm and degrees, in SI. Raises `InputError`."""
    values = [finite(name, value) for value in pose]
    if len(values) not in (3, 6):
        raise InputError(f"{name} of {len(values)} numbers", expected="X, Y, Z or X, Y, Z, A, B, C in mm and degrees")
    if max(map(abs, values[:3])) > FARTHEST_MM or max(map(abs, values[3:]), default=0.0) > FARTHEST_DEG:
        within = f"positions within +-{FARTHEST_MM:g} mm and angles within +-{FARTHEST_DEG:g} degrees"
        raise InputError(f"{name} {values}", expected=within)
    return pose_in_si(values)


def origin_si(origin_mm_deg: Sequence[float] | None) -> Pose | None:
    """A placement in SI, None if not given. Raises `InputError`."""
    return None if origin_mm_deg is None else pose_si("--origin", origin_mm_deg)
