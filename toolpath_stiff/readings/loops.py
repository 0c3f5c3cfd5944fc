"""Readings of indicators beside the tip, and the form in which they are compared.

Stiffnesses are compared by their logarithms. A joint that does not give way reads zero, which has none; and a strut
gets longer or shorter. So a loop's reading y (displacement per load, m/N) is compared as that of a spring in series
with it, whose compliance is known,

    k = 1 / (o + s y),

s = 1 or -1 so that s y is positive on the plain machine. The offset o is chosen, not measured: half the compliance of
the tip, and more where the reading's own scatter or a wrong sign asks for it. Then ln k changes by dy / (o + s y), an
ordinary residual, and models are compared on the scale on which they add up: that of compliance. A strut measured alone
is a stiffness of its own and has no offset.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from toolpath_stiff.arrays import AnyArray, BoolArray, FloatArray, IntArray
from toolpath_stiff.errors import MeasurementError
from toolpath_stiff.machine.kinematics import Struts
from toolpath_stiff.stiffness.measuring_loop import TIP, WORDS, MeasuringLoop, measuring_loop

# Scatter of one reading without `sd_um`: a lever indicator or probe with its stand, and the load; assumed.
INDICATOR_SD, LOAD_SHARE = 0.3e-6, 0.02  # m; of the reading
OFFSET_SHARE = 0.5  # of the tip's compliance
WIDEST = 0.05  # relative sd of offset and reading together up to which the logarithm is linear enough
BACKWARDS = 3.0  # least offset in multiples of a reading of the wrong sign, so that its logarithm exists


def loop_of(text: str) -> MeasuringLoop:
    """Loop that a cell names. Raises `InputError`."""
    loop = measuring_loop(text)
    if loop is None:
        raise MeasurementError(f"loop {text!r}", expected=WORDS)
    return loop


@dataclass(frozen=True)
class LoopColumns:
    """Loops of n readings, those beside the tip among them; SI.

    Attributes
    ----------
    loops, which
        The loops that occur, the tip's first; and which of them each reading (n,) is of.
    offset, toward
        (n,) m/N and 1 or -1: o and s above; 0 and 1 at the tip.
    length
        (n,) m, of a strut measured alone; nan: as the pose has it.
    """

    loops: tuple[MeasuringLoop, ...]
    which: IntArray
    offset: FloatArray
    toward: FloatArray
    length: FloatArray

    def select(self, rows: AnyArray) -> LoopColumns:
        """Columns of some of the readings."""
        return LoopColumns(self.loops, *(getattr(self, field.name)[rows] for field in fields(self)[1:]))

    @classmethod
    def of(cls, names: Sequence[str], length: FloatArray) -> LoopColumns:
        """Columns for readings' loops by name ("" is the tip), still without offsets."""
        loops = (TIP, *(loop_of(name) for name in dict.fromkeys(names) if name))
        number = {"" if k == 0 else str(loop): k for k, loop in enumerate(loops)}
        which = np.array([number[str(name)] for name in names], dtype=np.int64)
        return cls(loops, which, np.zeros(len(names)), np.ones(len(names)), length)

    @property
    def beside(self) -> BoolArray:
        """(n,) readings of loops other than the tip's."""
        return np.asarray(self.which > 0)

    @property
    def straight(self) -> BoolArray:
        """(n,) readings compared with an offset."""
        alone = np.array([loop.kind in ("tip", "alone") for loop in self.loops])
        return ~alone[self.which]

    def on_lengths(self, struts: Struts) -> Struts:
        """Struts of the readings' poses; a strut measured alone has the length it had then."""
        given = ~np.isnan(self.length)
        if not given.any():
            return struts
        lengths = np.where(given[:, None], self.length[:, None], struts.lengths)
        return replace(struts, lengths=lengths)

    def joined(self, compliance: FloatArray) -> FloatArray:
        """(n,) m/N with the offset in series, from readings' compliances (n,)."""
        return np.asarray(self.offset + self.toward * compliance)

    def alone(self, joined: FloatArray) -> FloatArray:
        """(n,) m/N as read, from compliances with the offset in series: the inverse of `joined`."""
        return np.asarray(self.toward * (joined - self.offset))


def offsets(
    columns: LoopColumns,
    read: FloatArray,
    sd: FloatArray,
    expected: FloatArray,
    way: FloatArray,
    tip: FloatArray,
    widest: float = WIDEST,
) -> LoopColumns:
    """Columns with offset and sign of every loop reading.

    Parameters
    ----------
    columns
        Without offsets.
    read, sd
        (n,) m/N, readings and their scatter; nan where they are planned.
    expected, tip
        (n,) m/N that the plain machine gives: of each loop, of the tip at the same pose along the same load.
    way
        (n,) below 0 where what a loop holds gets shorter under the load.
    widest
        Relative sd that no reading with its offset has more of.
    """
    toward = np.where(way < 0.0, -1.0, 1.0)
    counted = np.where(np.isnan(read), expected, read) * toward
    wanted = np.maximum.reduce([OFFSET_SHARE * tip, sd / widest - counted, -BACKWARDS * counted])
    kept = columns.straight
    return replace(columns, offset=np.where(kept, wanted, 0.0), toward=np.where(kept, toward, 1.0))
