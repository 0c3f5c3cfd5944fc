"""Measuring loops: the words of the column `loop`, and the links of the load path between an indicator's two points.

An indicator sees what gives way between the two points that it touches, nothing else. The tip loop, tool against work,
holds the whole load path; an indicator across one joint holds that joint alone.
"""

from dataclasses import dataclass

LINKS_ON_THE_PATH = ("tool", "platform", "joints", "struts", "frame", "table")
# Kind -> links of the load path between the indicator's two points.
INSIDE = {
    "tip": LINKS_ON_THE_PATH,
    "spindle": ("tool",),
    "platform": tuple(link for link in LINKS_ON_THE_PATH if link != "tool"),
    "table": ("table",),
    "frame": ("frame",),
    "joint": ("joints",),
    "strut": ("struts",),
    "alone": ("struts",),
}
# Kinds that read along the load, so that a reading is a stiffness; others read along a strut or across a vertex.
ALONG_THE_LOAD = ("tip", "spindle", "platform", "table")
WORDS = (
    "tip, spindle, platform, table, strut 1 (to 6), strut 1 alone, joint 1, joint 1 platform, joint 1 frame, frame 1 "
    "(to 3), frame 1 radial, frame 1 vertical"
)


@dataclass(frozen=True)
class MeasuringLoop:
    """The two points between which an indicator reads.

    Attributes
    ----------
    kind
        One of `INSIDE`.
    number
        Strut from 1 to 6, or vertex of the frame from 1 to 3 by its lowest strut; 0 where there is none.
    where
        Of a joint: "platform" or "frame", its end of the strut; "" both ends added. Of a vertex: "radial" or
        "vertical"; "" along the load.

    Examples
    --------
    >>> MeasuringLoop("strut", 3).links
    ('struts',)
    >>> str(measuring_loop("Joint 2  platform"))
    'joint 2 platform'
    """

    kind: str = "tip"
    number: int = 0
    where: str = ""

    def __str__(self) -> str:
        if self.kind == "alone":
            return f"strut {self.number} alone"
        return " ".join(filter(None, [self.kind, str(self.number or ""), self.where]))

    @property
    def links(self) -> tuple[str, ...]:
        """Links of the load path that it sees."""
        return INSIDE[self.kind]

    @property
    def along_load(self) -> bool:
        """True if it reads along the load."""
        return self.kind in ALONG_THE_LOAD or (self.kind == "frame" and not self.where)


TIP = MeasuringLoop()
_LOOPS = (
    *map(MeasuringLoop, ALONG_THE_LOAD),
    *(MeasuringLoop(kind, number) for kind in ("strut", "alone") for number in range(1, 7)),
    *(MeasuringLoop("joint", number, where) for number in range(1, 7) for where in ("", "platform", "frame")),
    *(MeasuringLoop("frame", number, where) for number in range(1, 4) for where in ("", "radial", "vertical")),
)
_NAMED = {"": TIP, **{str(loop): loop for loop in _LOOPS}}


def measuring_loop(text: str) -> MeasuringLoop | None:
    """Loop that a cell of the column `loop` names (empty: the tip's); None if it names none."""
    return _NAMED.get(" ".join(text.lower().split()))
