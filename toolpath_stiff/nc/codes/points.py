"""What the numbers and axis words of a block mean: increments, points and steps, polar words, rotated coordinates.

G68 and G69 follow Fanuc's milling controls (operator's manuals of the series 16 and 15i, "Coordinate system rotation"),
and so does G16 ("Polar coordinate command"); @ and ^ follow LinuxCNC ("G-Code Overview", "Polar Coordinates"). Where
these manuals leave the point to parameters or forbid the block, it is refused. Numbers without a decimal point are
whole units, or the least increments of Fanuc's and Haas' controls (Fanuc's operator's manuals, "Decimal point
programming"; Haas' "Help with the decimal points"). mm and degrees.
"""

from __future__ import annotations

import math

from toolpath_stiff.nc import geometry
from toolpath_stiff.nc.codes.code import Code
from toolpath_stiff.nc.controller import GENERIC, INCREMENT_DEGREE, INCREMENT_INCH, INCREMENT_MM
from toolpath_stiff.nc.frames import Rotation
from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, CORNERS, Word

SAME_PLACE_MM = 1e-9
XY = frozenset((0, 1))


def rotation(state: State, block: CurrentBlock, code: str) -> None:
    """G68 X Y R: programmed points turn about X, Y (absolute; without them about the present point). G69: rotation off.

    On Fanuc's controls incremental words between G68 and the first absolute ones turn about the tool's place at
    G68: from there on they are turned steps, as they are here.
    """
    frames = state.frames
    here = frames.to_program(frames.position)
    if code == "G69":
        frames.rotation = None
    else:
        new = _rotation_of(state, block, block.codes[code], here)
        if frames.rotation is not None and frames.rotation[:2] != new[:2]:
            raise block.fail(code, "with another centre while a rotation is in force", "G69 before it")
        frames.rotation = new
    there = frames.to_program(frames.position)
    if math.dist(here[:2], there[:2]) > SAME_PLACE_MM:
        state.unsettled = code


def _rotation_of(state: State, block: CurrentBlock, word: Word, here: list[float]) -> Rotation:
    if state.plane != "G17":
        raise block.fail(word, f"in the plane {state.plane}, which is not supported", "G17")
    solid = next((block.values[letter] for letter in "ZIJK" if block.has(letter)), None)
    if solid is not None:
        raise block.fail(solid, "makes G68 a rotation in space, which is not supported", "G68 X Y R in G17")
    angle = block.take("R")
    if angle is None:
        raise block.fail(word, "without its angle, which is then a parameter of the control", "R in degrees")
    present = state.frames.rotation
    if not state.absolute and present is not None:
        raise block.fail(
            word,
            "in incremental mode (G91) under a rotation: a parameter of the control says whether R adds",
            "G90, or G69 before it",
        )
    x, y = block.take("X"), block.take("Y")
    if present is not None:
        here = [*present[:2], *here[2:]] if x is None and y is None else here
    return (
        here[0] if x is None else x * state.length_scale,
        here[1] if y is None else y * state.length_scale,
        angle,
    )


def refuse_while_rotated(state: State, block: CurrentBlock, word: Word, what: str) -> None:
    """Refuse what Fanuc's controls forbid between G68 and G69."""
    if state.frames.rotation is not None:
        raise block.fail(word, f"{what} while the coordinate system is rotated (G68)", "G69 before it")


def forget_polar(state: State) -> None:
    """The tool or the zero moved by other than polar words: the next ones must name both."""
    if state.polar is not None:
        state.polar = [math.nan, math.nan]


def zero_moved(state: State) -> None:
    """Note that the zero of turned coordinates moved: LinuxCNC's rs274 forgets it at the next M6."""
    if state.frames.offsets.at(state.frames.active).rotation:
        state.rotation_changed = True


def know_place(state: State, block: CurrentBlock, word: Word) -> None:
    """Refuse what depends on the present X and Y, after a G10 that turned the offset in force."""
    if state.unsettled == "G10":
        raise block.fail(
            word,
            "depends on the present X and Y after G10, or another work offset and M6, turned the coordinates: "
            "LinuxCNC's interpreter may have other ones",
            "a move with both X and Y before it",
        )


def settle(state: State, block: CurrentBlock, words: dict[int, float]) -> None:
    """Refuse what a control may read as another point: X and Y had other numbers before the rotation changed."""
    named = XY & words.keys()
    if state.unsettled == "G10" and not (state.absolute and named == XY):
        raise block.fail(
            None,
            "G10, or another work offset and M6, turned the coordinates, and the next move does not name both X "
            "and Y: LinuxCNC would take the old numbers for them",
            "absolute X and Y in the first move after it",
        )
    if not named:
        return
    word = block.values[AXES[min(named)]]
    if state.absolute and named == XY:
        state.unsettled = None
    elif state.absolute:
        raise block.fail(word, f"alone in the first move after {state.unsettled}", "both X and Y")
    elif state.unsettled == "G69":
        raise block.fail(word, "is incremental in the first move after G69", "absolute X and Y (G90)")


_FANUC_ROTATION = "Fanuc, operator's manuals of the series 16 and 15i, Coordinate system rotation (G68, G69)"
ROTATION_CODES = (
    Code("G68", "rotation", rotation, "rotated coordinates", _FANUC_ROTATION, takes_axes=True),
    Code("G69", "rotation", rotation, "rotation off", _FANUC_ROTATION),
)


LINEAR = frozenset("XYZ")


def axis_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """Axis index -> value of the block's axis words in mm and degrees; they then count as used."""
    axis_values = {}
    for index, letter in enumerate(AXES):
        value = block.take(letter)
        if value is not None:
            axis_values[index] = value * state.length_scale if letter in LINEAR else value
    return axis_values


def point_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """As `axis_words`, of a block that moves in program coordinates: under G16 the second one is an angle."""
    block.polar_words = None
    if block.has("@") or block.has("^"):
        return _at_radius_and_angle(state, block)
    if state.polar is None:
        words = axis_words(state, block)
        if state.unsettled:
            settle(state, block, words)
        return words
    second = geometry.PLANES[state.plane][1]
    angle = block.take(AXES[second])
    words = axis_words(state, block)
    if angle is not None:
        words[second] = angle
    return words


def cartesian(state: State, here: list[float], words: dict[int, float]) -> list[float]:
    """The point that words name in the distance mode in force, coming from `here`."""
    point = list(here)
    for axis, value in words.items():
        point[axis] = coordinate(state, here[axis], value)
    return point


def coordinate(state: State, here: float, value: float) -> float:
    """The coordinate that an axis word names: that number (G90), or that far from `here` (G91)."""
    return value if state.absolute else here + value


def destination(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Program coordinates of the point that words from `point_words` name, coming from `here`."""
    point = cartesian(state, here, words)
    if state.polar is not None:
        first, second, _ = geometry.PLANES[state.plane]
        if first in words or second in words:
            point[first], point[second] = _polar_point(state, block, words.get(first), words.get(second))
    return point


def control_point(state: State, block: CurrentBlock, here: list[float], words: dict[int, float]) -> list[float]:
    """Control coordinates of that point.

    Where nothing turns, axis by axis: one that is not named keeps its number to the last digit, and a step is added to
    that number.
    """
    frames = state.frames
    point = frames.to_control(destination(state, block, here, words))
    if state.polar is None and not frames.rotated:
        for axis, present in enumerate(frames.position):
            if axis not in words:
                point[axis] = present
            elif not state.absolute:
                point[axis] = present + words[axis]
    return point


def _at_radius_and_angle(state: State, block: CurrentBlock) -> dict[int, float]:
    """LinuxCNC's polar words: @ the radius, ^ the angle about the program zero, of the XY plane.

    As measured on `rs274` 2.9: the one that is absent is that of the present point; in G91 both add to it.
    """
    word = block.values["@" if block.has("@") else "^"]
    if state.dialect.increments:
        raise block.fail(word, f"is not a word of the dialect {state.dialect.name}", "X and Y, or G16")
    if state.plane != "G17" or state.polar is not None or state.unsettled or state.frames.rotation is not None:
        raise block.fail(word, "is a polar word outside of G17, or under G16 or a rotation", "X and Y")
    if block.has("X") or block.has("Y"):
        raise block.fail(word, "is a polar word beside X or Y", "either")
    block.polar_words = (word, block.take("@"), block.take("^"))
    return {**axis_words(state, block), **xy_of_polar_words(state, block)}


def xy_of_polar_words(state: State, block: CurrentBlock) -> dict[int, float]:
    """X and Y, as words in the distance mode in force, of the block's polar words at the present point."""
    assert block.polar_words is not None
    word, radius, angle = block.polar_words
    here = state.frames.to_program(state.frames.position)
    present, turn = math.hypot(here[0], here[1]), math.atan2(here[1], here[0])
    if present < SAME_PLACE_MM and (radius is None or angle is None or not state.absolute):
        raise block.fail(word, "counts from the present point, which is the program zero", "both @ and ^, in G90")
    if radius is not None:
        present = radius * state.length_scale + (0.0 if state.absolute else present)
    if angle is not None:
        turn = math.radians(angle) + (0.0 if state.absolute else turn)
    point = (present * math.cos(turn), present * math.sin(turn))
    return {axis: value if state.absolute else value - here[axis] for axis, value in enumerate(point)}


def polar_mode(state: State, block: CurrentBlock, code: str) -> None:
    """G16: the plane's first axis word is a radius, the second an angle. G15: they are Cartesian."""
    state.polar = [math.nan, math.nan] if code == "G16" else None


def _polar_point(state: State, block: CurrentBlock, radius: float | None, angle: float | None) -> tuple[float, float]:
    first, second = (AXES[axis] for axis in geometry.PLANES[state.plane][:2])
    polar = state.polar
    assert polar is not None
    if radius is not None:
        if not state.absolute:
            raise block.fail(
                first,
                "is a polar radius in incremental mode (G91)",
                "a radius from the program zero (G90); the angle alone may be incremental",
            )
        polar[0] = radius
    if angle is not None:
        polar[1] = angle if state.absolute else polar[1] + angle
    if math.isnan(polar[0]) or math.isnan(polar[1]):
        raise block.fail(
            second if radius is None else first,
            "is half of a polar point, and nothing before it gives the other half",
            f"{first} (radius) and {second} (angle), absolute",
        )
    state.unsettled = None
    turn = math.radians(polar[1])
    return (polar[0] * math.cos(turn), polar[0] * math.sin(turn))


_FANUC_POLAR = "Fanuc, operator's manuals of the series 16 and 15i, Polar coordinate command (G15, G16)"
POLAR_CODES = (
    Code("G15", "polar", polar_mode, "Cartesian words", _FANUC_POLAR),
    Code("G16", "polar", polar_mode, "polar words", _FANUC_POLAR),
)


ANGLES = frozenset("ABC")
LENGTHS = frozenset((*"XYZIJKRQ", *CORNERS))
INCREMENTS = (
    "lengths and angles without a decimal point count least increments (0.001 mm, 0.0001 inch, 0.001 degrees: IS-B), "
    "as in the dialect {}"
)
MIXED = (
    "some lengths end with their decimal point (X10.), and {} in line {} has none: Fanuc's and Haas' controls count "
    "such a number in 0.001 mm or 0.0001 inch; here it counts whole units, unless --dialect says otherwise"
)


def read_numbers(state: State, block: CurrentBlock) -> None:
    """Give the block's words their values in program units, by the dialect's decimal-point rule."""
    if not state.dialect.increments:
        if watches_points(state):
            _watch_points(state, block)
        return
    inch = block.groups.get("units", "G20" if state.inch else "G21") == "G20"
    angles = set(ANGLES)
    if block.groups.get("rotation") == "G68":
        angles.add("R")
    polar = block.groups["polar"] == "G16" if "polar" in block.groups else state.polar is not None
    if polar and "non-modal" not in block.groups:
        angles.add(AXES[geometry.PLANES[block.groups.get("plane", state.plane)][1]])
    for letter, word in block.values.items():
        if "." in word.text or not word.value or not (letter in LENGTHS or letter in angles) or is_count(block, letter):
            continue
        block.values[letter] = word._replace(value=word.value * increment(letter in angles, inch))
        assume_increments(state)


def is_count(block: CurrentBlock, letter: str) -> bool:
    """Whether a letter of lengths is a number of something else: G5.1 Q1, M61 Q5, M98 Q5."""
    return letter == "Q" and ("look-ahead" in block.groups or not {"M61", "M98"}.isdisjoint(block.codes))


def increment(angle: bool, inch: bool) -> float:
    """The least increment of a word: degrees of an angle, or the unit of length in force."""
    return INCREMENT_DEGREE if angle else INCREMENT_INCH if inch else INCREMENT_MM


def assume_increments(state: State) -> None:
    """Say that numbers without a point were counted in increments."""
    state.assume(INCREMENTS.format(state.dialect.name))


def increments_hint(state: State) -> str:
    """What to do about an arc that fits nowhere, once numbers without a point were counted in increments."""
    if INCREMENTS.format(state.dialect.name) not in state.assumptions:
        return ""
    step, unit = ("0.0001", "inch") if state.inch else ("0.001", "mm")
    name = state.dialect.name
    return f"numbers without a point are read in {step} {unit} (--dialect {name}); without it X10 is 10 {unit}"


def watches_points(state: State) -> bool:
    """Whether the dialect leaves open what such numbers count, and no warning was given yet."""
    return state.dialect.name == GENERIC.name and (state.bare is None or not state.pointed)


def _watch_points(state: State, block: CurrentBlock) -> None:
    """Notice what looks like a program for a control that counts increments."""
    for letter, word in block.values.items():
        if letter not in LENGTHS or not word.value or is_count(block, letter):
            continue
        if word.text.endswith("."):
            state.pointed = True
        elif state.bare is None and "." not in word.text and "E" not in word.text.upper():
            state.bare = (block.line, word)
    warn_of_points(state)


def warn_of_points(state: State) -> None:
    """Say, once, that some lengths have their decimal point and others none."""
    if state.pointed and state.bare is not None:
        state.warnings.append(MIXED.format(state.bare[1].text, state.bare[0]))
