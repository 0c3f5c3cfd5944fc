"""A program to be read, and all that is known of its control: the input of the reader of each language."""

import copy
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from toolpath_stiff.nc.controller import UNKNOWN_CONTROL, Controller
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.lines import TextLines
from toolpath_stiff.nc.moves import ReadProgram, Remark
from toolpath_stiff.nc.state import Record, State
from toolpath_stiff.nc.tables import Offsets
from toolpath_stiff.poses import Pose, ShopPose, pose_in_mm

ZERO: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ORIGIN_WINS = Remark(
    "the program or the offsets file sets G54; --origin overrides it, other offsets keep their distance to it"
)


@dataclass(frozen=True)
class Request:
    """A program to be read, and the options for reading it.

    Attributes
    ----------
    lines, name, path
        The program, what messages call it, and its file, "" for text.
    origin, default_origin
        Where program zero (G54) sits in machine coordinates, x, y, z in m, A, B, C in rad: as asked for, and
        where neither the caller nor the program says so. Only moves in machine coordinates (G53, G28, G30) depend on
        it.
    interpreter
        "builtin"; "linuxcnc", LinuxCNC's own (`rs274`); "auto", the first and, where it refuses, the second.
    rs274
        Path of the program `rs274`, if it is not on PATH.
    unconfined
        Run it even where bubblewrap, which keeps it from all files but its own, cannot be used.
    controller
        Dialect, block-delete switches, work offsets and tools of the control, and the kinematics that the program was
        posted for.
    """

    lines: tuple[str, ...]
    name: str
    path: str = ""
    origin: Pose | None = None
    default_origin: Pose = ZERO
    interpreter: str = "builtin"
    rs274: str | None = None
    unconfined: bool = False
    controller: Controller = UNKNOWN_CONTROL

    @cached_property
    def work_offsets(self) -> Offsets:
        """Work offsets before the program sets any."""
        return self.controller.offsets or Offsets()

    @property
    def zero(self) -> tuple[ShopPose | None, ShopPose]:
        """G54's zero, mm and degrees: as given by the caller, and the default.

        A program that was posted for another machine is read in that one's coordinates first.
        """
        if self.controller.kinematics is not None:
            return None, ZERO
        return None if self.origin is None else pose_in_mm(self.origin), pose_in_mm(self.default_origin)

    def start(self) -> State:
        """The state of the control before the first block."""
        frames = Frames(copy.deepcopy(self.work_offsets), *self.zero, posted=self.controller.kinematics)
        control = self.controller
        return State(self.name, frames, control.dialect, tools=copy.deepcopy(control.tools), feed=control.feed)

    def program(self, record: Record, **more: Any) -> ReadProgram:
        """The program made of a reading's record; `more`: other attributes of `ReadProgram`."""
        return ReadProgram(
            self.name, self.path, TextLines(self.lines), record.recorder.moves(), unsupported=tuple(record.unsupported),
            tools=tuple(record.used_tools.values()), **more,
        )  # fmt: skip
