"""HAL and ini files of LinuxCNC: pins of its kinematics module, limits and letters of joints, units.

A pin has the value that `setp` gives it, or that `sets` gives the signal of its `net`; `[SECTION]KEY` stands for one of
the ini file. HALCMD lines of an ini file are lines of HAL.
"""

import re
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file, read_bytes
from toolpath_stiff.units import MM_PER_INCH, deg_from_rad, m_from_mm, mm_from_m, rad_from_deg

UNITS_MM = {"mm": 1.0, "inch": MM_PER_INCH}
SAME_UNIT = {"mm": "mm", "metric": "mm", "inch": "inch", "in": "inch", "imperial": "inch"}
SECTION, ENTRY = re.compile(r"\s*\[(\w+)\]"), re.compile(r"\s*(\w+)\s*=\s*(.*?)\s*$")
VARIABLE = re.compile(r"\[(\w+)\]\(?(\w+)\)?$")
Entries = list[tuple[str, str, str]]  # section, key, value
HalLine = tuple[str, int, str]  # file, line, text


@dataclass(frozen=True)
class ControlFiles:
    """Content of the HAL and ini files of one machine.

    Attributes
    ----------
    file
        For messages and the machine's source.
    module
        The kinematics module that they load; "" where they load none.
    units
        "mm" or "inch".
    pins
        Values of the module's pins, in its own units.
    limits
        Joint -> (2,) of its own units.
    coordinates
        Letters of the joints, "" where nobody says.
    unset
        Pins that were asked for and nobody sets: they are 0.
    """

    file: str
    module: str
    units: str
    pins: dict[str, float]
    limits: dict[int, FloatArray]
    coordinates: str = ""
    unset: list[str] = field(default_factory=list)

    @property
    def scale(self) -> float:
        """Mm of a length."""
        return UNITS_MM[self.units]

    @property
    def travel(self) -> tuple[float | None, float | None]:
        """Shortest and longest strut, mm, that all joints reach; None where they have no limits."""
        if not self.limits:
            return None, None
        low, high = np.array(list(self.limits.values())).T * self.scale
        return float(low.max()), float(high.min())

    def pin(self, name: str, default: float | None = None) -> float:
        """The value of a pin. Raises `InputError` where it must be set and is not."""
        if name not in self.pins and default is None:
            raise InputError(f"{self.module}.{name} is not set", expected=f"setp {self.module}.{name}", file=self.file)
        if name not in self.pins:
            self.unset.append(name)
        return self.pins.get(name, default or 0.0)

    def length(self, name: str, default: float | None = None) -> float:
        """Mm of a pin."""
        return self.pin(name, default) * self.scale

    def bounds(self, joint: int, linear: bool) -> FloatArray | None:
        """Limits of a joint, m or rad; None: not stated."""
        if joint not in self.limits:
            return None
        return m_from_mm(self.limits[joint] * self.scale) if linear else rad_from_deg(self.limits[joint])

    def limits_of(self, axes: str, letters: str) -> Document:
        """Keys of [limits] by letter, None if not stated; `letters` are the joints' unless the files name them."""
        letters = self.coordinates or letters
        keys: dict[str, FloatArray | None] = {}
        for axis in axes:
            linear = axis in "XYZ"
            bounds = self.bounds(letters.index(axis), linear) if axis in letters else None
            shop = mm_from_m if linear else deg_from_rad
            keys[f"{axis}_{'mm' if linear else 'deg'}"] = None if bounds is None else shop(bounds)
        return keys


def read_control(path: Path, modules: Collection[str], units: str | None = None) -> ControlFiles:
    """Content of a HAL file and the ini files beside it that load it, or of an ini file and the HAL files it loads.

    `modules` are the kinematics modules that are known; `units` are "mm" or "inch", else LINEAR_UNITS.
    Raises `InputError` for a pin that is no number, ini files that contradict each other, and no unit.
    """
    text = read_bytes(path, "the file of HAL pins").decode("utf-8", "replace")
    if path.suffix == ".ini":
        entries = _entries(text)
        beside = [path.parent / value for _, key, value in entries if key == "HALFILE"]
        files = [(file.name, file.read_text("utf-8", "replace")) for file in beside if is_file(file)]
    else:
        read = [_entries(ini.read_text("utf-8", "replace")) for ini in sorted(path.parent.glob("*.ini"))]
        loading = [ini for ini in read if any(key.endswith("HALFILE") and value == path.name for _, key, value in ini)]
        entries, files = [entry for ini in loading or read for entry in ini], [(path.name, text)]
    hal = [(name, number, line) for name, lines in files for number, line in enumerate(lines.splitlines(), 1)]
    hal += [(path.name, 0, value) for _, key, value in entries if key == "HALCMD"]
    unit = units or SAME_UNIT.get(_only(entries, "LINEAR_UNITS", path).lower(), "")
    if not unit:
        mistake = "the unit of the pins is not known (no ini file beside it that says LINEAR_UNITS)"
        raise InputError(mistake, hint="give it with --units mm or --units inch", file=str(path))
    loads, *words = _only(entries, "KINEMATICS", path).split() or [""]
    named = [loads] if loads else [word.split(".")[0] for *_, line in hal for word in line.split("#")[0].split()[1:]]
    module = next((name for name in named if name in modules), loads)
    letters = re.search(r"(?i)coordinates=(\w+)", " ".join(words))
    coordinates = letters[1] if letters else next((v for _, key, v in entries if key == "COORDINATES"), "")
    limits: dict[int, list[float]] = {}
    for section, key, value in entries:
        if section.startswith("JOINT_") and key in ("MIN_LIMIT", "MAX_LIMIT"):
            limits.setdefault(int(section[6:]), [-np.inf, np.inf])[key == "MAX_LIMIT"] = float(value)
    both = {joint: np.array(ends) for joint, ends in limits.items() if np.isfinite(ends).all()}
    pins = read_pins(hal, module, entries)
    return ControlFiles(path.name, module, unit, pins, both, coordinates.replace(" ", "").upper())


def _entries(ini: str) -> Entries:
    section, entries = "", []
    for line in ini.splitlines():
        if heading := SECTION.match(line):
            section = heading[1]
        elif entry := ENTRY.match(line):
            entries.append((section, entry[1], entry[2]))
    return entries


def _only(entries: Entries, key: str, path: Path) -> str:
    """The value of a key that all ini files give alike; "" where none does."""
    values = sorted({value for _, name, value in entries if name == key})
    if len(values) > 1:
        hint = "give the ini file of the machine in place of the HAL file"
        raise InputError(f"the ini files beside it say {key} = {' and '.join(values)}", hint=hint, file=str(path))
    return values[0] if values else ""


def read_pins(hal: list[HalLine], module: str, entries: Entries) -> dict[str, float]:
    """Pins of a module. Raises `InputError` at the line of what is no number or set twice."""
    signals: dict[str, str] = {}
    given: dict[str, tuple[HalLine, str]] = {}
    for place in hal:
        verb, name, *rest = [*re.split(r"[\s=<>]+", place[2].split("#")[0].strip()), "", ""]
        if verb == "net":
            signals |= {pin: name for pin in rest if pin.startswith(f"{module}.")}
        elif verb in ("setp", "sets") and (verb == "sets" or name.startswith(f"{module}.")):
            if verb == "setp" and name in given:
                raise InputError(f"{name} is set twice", file=place[0], line=place[1])
            given[name] = place, rest[0]
    given |= {pin: given[signal] for pin, signal in signals.items() if signal in given}
    variables = {(section, key): value for section, key, value in entries}
    values = {}
    for pin, ((file, line, _), raw) in given.items():
        if not pin.startswith(f"{module}."):
            continue
        variable = VARIABLE.match(raw)
        word = variables.get((variable[1], variable[2]), raw) if variable else raw
        try:
            value = float(word)
        except ValueError:
            expected = "a number" + (", or the ini file that has the variable" if variable else "")
            raise InputError(f"{pin} = {word!r}", expected=expected, file=file, line=line or None) from None
        if not np.isfinite(value):
            raise InputError(f"{pin} = {word!r}", expected="a finite number", file=file, line=line or None)
        values[pin.removeprefix(f"{module}.")] = value
    return values
