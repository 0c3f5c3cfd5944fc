"""What the same words mean on different controls.

`generic` is the meaning that most programs share: plain numbers, LinuxCNC's start-up state; where Fanuc's controls and
LinuxCNC would make different paths of a block, it is refused. The others settle it. Sources: LinuxCNC's manual
("G-Code overview", "Canned cycles"); Fanuc's operator's manuals ("Decimal point programming", "Canned cycle"); Haas'
"Help with the decimal points" (settings 77 and 162) and mill operator's manual (G70 to G72, G98).
"""

from __future__ import annotations

from dataclasses import dataclass

from toolpath_stiff.errors import InputError

# IS-B, the increment system of nearly every Fanuc and Haas: what a number without a decimal point counts.
INCREMENT_MM, INCREMENT_INCH, INCREMENT_DEGREE = 1e-3, 1e-4, 1e-3

SECONDS, MILLISECONDS, BY_POINT = "s", "ms", "ms without, s with a decimal point"
LATHE_CYCLE = ("a lathe cycle", "this is a mill")
UNITS_OR_CYCLE = (
    "inch or metric units on some controls, a cycle on others",
    'write G20 or G21, or give a controller file with inch_metric = "G70 G71"',
)
HOLE_PATTERN = ("a pattern of holes", "post the holes one by one")


@dataclass(frozen=True)
class Dialect:
    """The meanings in which controls differ.

    Attributes
    ----------
    name
        As `--dialect` takes it.
    increments
        Lengths and angles without a decimal point count least increments: `X10` is 0.01 mm and `X10.` 10 mm.
    dwell
        What the P of G4 and of cycles counts; with milliseconds, G4 X is a time too.
    retract
        G98 or G99 at the start; None: nobody says, LinuxCNC's habit (G99) is assumed and listed.
    keeps_heights
        Whether a drilling cycle's hole keeps its depth when G90 or G91 follows, or Z and R are read anew (LinuxCNC);
        None: refused.
    repeats_in_p
        `M98 P21000` is two runs of O1000 (True), O21000 (False), or whichever the file has (None).
    cycle_repeats
        The words that say how often a cycle's block drills.
    semicolon
        Whether `;` begins a comment; else it ends the block, and nothing may follow it.
    arc_absolute
        Whether I, J, K are absolute at the start (G90.1).
    g70, inch_metric
        Why G70 and G71 are refused; whether they are inch and metric units.
    additional
        The codes that take additional work offsets.
    local_calls
        Whether M97 calls a block by its N number.
    feed_needs_point
        Units in which F without a decimal point hangs on a parameter, and is refused.
    holds_tip
        Its code for tool centre point control.
    """

    name: str
    increments: bool = False
    dwell: str = SECONDS
    retract: str | None = None
    keeps_heights: bool | None = None
    repeats_in_p: bool | None = None
    cycle_repeats: str = "L"
    semicolon: bool = True
    arc_absolute: bool = False
    g70: tuple[str, str] = UNITS_OR_CYCLE
    inch_metric: bool = False
    additional: tuple[str, ...] = ("G54.1", "G154")
    local_calls: bool = False
    feed_needs_point: tuple[str, ...] = ()
    holds_tip: str = "G43.4"


GENERIC = Dialect("generic")
DIALECTS = {
    dialect.name: dialect
    for dialect in (
        GENERIC,
        Dialect("linuxcnc", keeps_heights=False, repeats_in_p=False, g70=LATHE_CYCLE, additional=()),
        Dialect(
            "fanuc",
            increments=True,
            dwell=MILLISECONDS,
            retract="G98",
            keeps_heights=True,
            repeats_in_p=True,
            cycle_repeats="KL",
            semicolon=False,
            inch_metric=True,
            additional=("G54.1",),
            feed_needs_point=("inch",),
        ),
        Dialect(
            "haas",
            increments=True,
            dwell=BY_POINT,
            retract="G98",
            keeps_heights=True,
            repeats_in_p=False,
            semicolon=False,
            g70=HOLE_PATTERN,
            additional=("G154",),
            local_calls=True,
            feed_needs_point=("mm", "inch"),
            holds_tip="G234",
        ),
    )
}


def dialect_named(name: str) -> Dialect:
    """The dialect of a name. Raises `InputError`."""
    if name not in DIALECTS:
        raise InputError(f"dialect {name!r}", expected=", ".join(DIALECTS))
    return DIALECTS[name]
