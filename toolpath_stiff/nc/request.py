"""A program that is to be read, and all that is known of its control: what the readers of every language take."""

from __future__ import annotations

import copy
from dataclasses import dataclass

from toolpath_stiff.hints import both_names
from toolpath_stiff.nc.controller import Controller, Switches, switches_on
from toolpath_stiff.nc.frames import Frames
from toolpath_stiff.nc.kinematics import PostedKinematics
from toolpath_stiff.nc.state import State
from toolpath_stiff.nc.tables import Offsets, ToolEntry
from toolpath_stiff.units import Pose, ShopPose, pose_in_mm

ZERO: Pose = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
ORIGIN_WINS = (
    f"the program or the offsets file sets G54; {both_names('--origin')} overrides it, other offsets keep their "
    "distance to it"
)


@dataclass(frozen=True)
class Request:
    """A program to be read, and with what; as in `reader.read_program`, `origin` and `default_origin` in m and rad."""

    lines: tuple[str, ...]
    name: str
    path: str
    origin: Pose | None
    default_origin: Pose
    offsets: Offsets
    tools: dict[int, ToolEntry] | None
    block_delete: Switches
    interpreter: str
    rs274: str | None
    unconfined: bool
    controller: Controller

    @property
    def posted(self) -> PostedKinematics | None:
        """The kinematics that the program was posted for; None: this machine's."""
        return self.controller.kinematics

    @property
    def switches(self) -> frozenset[int]:
        """Block-delete switches that are on."""
        return switches_on(self.block_delete, self.controller)

    @property
    def zero(self) -> tuple[ShopPose | None, ShopPose]:
        """Where G54's zero sits, mm and degrees, as the caller says, and by default.

        A program that was posted for another machine is read in that one's coordinates first.
        """
        if self.posted is not None:
            return None, ZERO
        return None if self.origin is None else pose_in_mm(self.origin), pose_in_mm(self.default_origin)

    def start(self) -> State:
        """The control as the program finds it."""
        frames = Frames(copy.deepcopy(self.offsets), *self.zero, posted=self.posted)
        state = State(self.name, frames, copy.deepcopy(self.tools), self.controller.dialect)
        state.feed = self.controller.feed
        return state
