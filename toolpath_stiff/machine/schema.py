"""Schema of machine files: sections, keys, units, bounds; values are checked against it, one fault a message."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import ORIGINS
from toolpath_stiff.toml_reader import TomlReader, is_number, is_text, shortened


class MachineToml(TomlReader):
    """Text of a machine file, and errors at its sections and keys."""

    def fault(self, section: str, key: str, mistake: str, expected: str = "", hint: str = "") -> InputError:
        """Error at a key of a section, or at the section itself."""
        label = f"[{section}] {key}".strip() if section else key
        line = self.line_of(section, key)
        if section.endswith("]"):  # section is a row of a list of tables
            name, _, number = section[:-1].partition("[")
            label, line = f"[[{name}]] {number} {key}".strip(), line or self.line_at(section)
        return InputError(f"{label}{mistake}", expected=expected, hint=hint, file=self.file, line=line)

    def rows(self, name: str) -> list[Document]:
        """Tables `[[name]]`. Raises `InputError` if the key is something else."""
        rows = self.data.get(name, [])
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise self.fault("", name, f" is not a list of tables; write [[{name}]]")
        return rows


@dataclass(frozen=True)
class Key:
    """Values that a key of a machine file may have.

    `shape` () for a number, (3,) or (6, 3) for lists, (1, 0) for rows of any length; `also_length` admits a second
    length, `many` any greater one, `or_one` a single number instead of a list. Texts are `shape[0]` or more.
    Bounds are inclusive unless `open_low`.
    """

    unit: str = ""
    shape: tuple[int, ...] = ()
    low: float = -1e5
    high: float = 1e5
    required: bool = True
    text: bool = False
    infinite: bool = False
    open_low: bool = False
    also_length: int | None = None
    many: bool = False
    or_one: bool = False

    @property
    def expected(self) -> str:
        """Values allowed, in words."""
        if self.text:
            return "a text"
        count = " rows of ".join(map(str, self.shape))
        if self.also_length:
            count += f" or {self.also_length}"
        if self.many:
            count = f"{'a number or ' if self.or_one else ''}{count} or more"
        unit = f" in {self.unit}" if self.unit else ""
        low = f"above {self.low:g}" if self.open_low else f"at least {self.low:g}"
        high = "" if math.isinf(self.high) else f", at most {self.high:g}"
        return f"{f'{count} numbers' if self.shape else 'a number'}{unit}, {low}{high}"

    def fits(self, shape: tuple[int, ...]) -> bool:
        """True if numbers of this shape are allowed."""
        if self.many and len(shape) == len(self.shape):
            return shape[0] >= self.shape[0] and all(
                n in (0, m) for m, n in zip(shape[1:], self.shape[1:], strict=True)
            )
        return shape in (self.shape, (self.also_length,)) or (self.or_one and not shape)


JOINTS = {
    "mm": Key(unit="mm", shape=(6, 3), required=False),
    # Rows of radius, angle about Z, height: keeps the symmetry of a machine exact, and reads better.
    "cylindrical_mm_deg": Key(unit="mm, deg, mm", shape=(6, 3), required=False),
}
OFFSETS = Key(unit="mm", shape=(6, 3), low=-30.0, high=30.0)
ANGLE = Key(unit="deg", low=0.0, high=180.0, open_low=True, infinite=True)
CORNER = Key(unit="mm", shape=(3,))
# Sections common to all kinds of machines.
NAMES = {"name": Key(text=True), **dict.fromkeys(("kind", "title", "source"), Key(text=True, required=False))}
SETUP = {
    "default_origin_mm": Key(unit="mm[, deg]", shape=(3,), also_length=6),
    "rapid_mm_per_min": Key(unit="mm/min", low=0.0, high=1e6, open_low=True),
    "name": Key(text=True, required=False),
    "names": Key(text=True, shape=(0,), required=False),
    "temperature_C": Key(unit="degrees C", low=-50.0, high=200.0, required=False),
}

SECTIONS: dict[str, dict[str, Key]] = {
    "": NAMES,
    **dict.fromkeys(("frame_joints", "platform_joints"), JOINTS),
    "reference_tool": {"length_mm": Key(unit="mm", low=0.0, high=2000.0)},
    "strut_law": {
        "length_mm": Key(unit="mm", shape=(2,), low=0.0, open_low=True, required=False, many=True),
        "stiffness_N_per_um": Key(unit="N/um", shape=(2,), low=1e-6, high=1e5, many=True, or_one=True),
    },
    "platform": {"bar_stiffness_N_per_m": Key(unit="N/m", low=1e5, high=math.inf, infinite=True, open_low=True)},
    "as_built": {
        "struts_percent": Key(unit="%", shape=(6,), low=-50.0, high=100.0),
        "frame_joints_mm": OFFSETS,
        "platform_joints_mm": OFFSETS,
    },
    "limits.strut_length": {"min_mm": Key(unit="mm", low=0.0), "max_mm": Key(unit="mm", low=0.0, open_low=True)},
    "limits.joint_angle": {
        "frame_max_deg": ANGLE,
        "platform_max_deg": ANGLE,
        "neutral_pose_mm_deg": Key(unit="mm, deg", shape=(6,)),
    },
    "limits.workspace": {"min_mm": CORNER, "max_mm": CORNER},
    "limits.singularity": {"min_index": Key(low=0.0, high=1.0)},
    "setup": SETUP,
}
OPTIONAL_SECTIONS = ("limits.joint_angle", "limits.workspace", "limits.singularity", "platform", "as_built", "setup")
BESIDE = ("effect", "instrument", "uncertainty")  # sections read elsewhere

Schema = Mapping[str, Mapping[str, Key]]
Sections = dict[str, Document]  # section -> key -> value in the units of the file; lists as arrays


def read_sections(toml: MachineToml, schema: Schema, optional: Collection[str], stated: bool = True) -> Sections:
    """Sections of a file, each key checked; unknown and missing ones are errors.

    `schema` is section -> keys, "" the keys above all sections, `[]` after the name of a list of tables, which
    `read_rows` reads; sections that may be missing are `optional`. `stated`: each says where its figures come from.
    """
    top: dict[str, object] = {}
    sections: Sections = {"": top}
    for name, content in toml.data.items():
        nested = name == "limits" and isinstance(content, dict) and "limits" not in schema
        for full, part in ((f"limits.{key}", part) for key, part in content.items()) if nested else [(name, content)]:
            if full in BESIDE or f"{full}[]" in schema:
                continue
            if full in schema:
                if not isinstance(part, dict):
                    raise toml.fault("", full, f" = {part!r}", expected=f"a section [{full}]")
                sections[full] = part
            elif nested or isinstance(part, dict):
                known = ", ".join(f"[[{name[:-2]}]]" if name[-2:] == "[]" else f"[{name}]" for name in schema if name)
                expected = f"one of {known}, [[effect]], [[instrument]], [uncertainty]"
                line = toml.line_at(full)
                raise InputError(f"unknown section [{full}]", expected=expected, file=toml.file, line=line)
            else:
                top[full] = part
    for name in schema:
        if name not in sections and name not in optional and name[-2:] != "[]":
            hint = "`tps machine new template.toml` writes a template with every section"
            raise InputError(f"section [{name}] is missing", hint=hint, file=toml.file)
    return {name: read_section(toml, name, content, schema[name], stated) for name, content in sections.items()}


def read_section(
    toml: MachineToml, name: str, content: Document, keys: Mapping[str, Key], stated: bool = False
) -> Document:
    """One section, as of `read_sections`."""
    allowed = [*keys, *(("origin", "remark") if name else ())]
    for key in content:
        if key not in allowed:
            raise toml.fault(name, key, ": unknown key", expected=f"one of {', '.join(allowed)}")
    for key, rule in keys.items():
        if rule.required and key not in content:
            raise toml.fault(name, key, " is missing", expected=rule.expected)
    needed = stated and name not in ("", "setup")
    if (needed or "origin" in content) and name != "setup" and content.get("origin") not in ORIGINS:
        mistake = f" = {content['origin']!r}" if "origin" in content else " is missing"
        raise toml.fault(name, "origin", mistake, expected=f"one of {', '.join(ORIGINS)}")
    return {key: _value(toml, name, key, v, keys[key]) if key in keys else str(v) for key, v in content.items()}


def read_rows(toml: MachineToml, name: str, keys: Mapping[str, Key]) -> list[Document]:
    """Tables `[[name]]` of a file, each key checked as in a section; errors name the row."""
    return [read_section(toml, f"{name}[{nth}]", row, keys) for nth, row in enumerate(toml.rows(name), 1)]


def _value(toml: MachineToml, section: str, key: str, raw: Any, rule: Key) -> Any:
    if rule.text:
        names = raw if rule.shape else [raw]
        fits = isinstance(names, list) and all(map(is_text, names)) and len(names) >= sum(rule.shape)
        if not fits or len(set(names)) < len(names):
            expected = "a list of names, each once" if rule.shape else "a text that is not empty"
            raise toml.fault(section, key, f" = {shortened(raw)}", expected)
        return tuple(names) if rule.shape else raw
    array = as_array(raw)
    if array is None or not rule.fits(array.shape):
        raise toml.fault(section, key, f" = {shortened(raw)}", rule.expected)
    bad = np.isnan(array) | (array < rule.low) | (array > rule.high)
    bad |= (rule.open_low & (array <= rule.low)) | (not rule.infinite) & np.isinf(array)
    if bad.any():
        raise toml.fault(section, key, f" = {float(array[bad][0]):g}", rule.expected)
    return float(array) if array.ndim == 0 else array


def as_array(raw: Any) -> FloatArray | None:
    """Float array of TOML numbers and lists of them; None for anything else (booleans too)."""

    def numeric(item: Any) -> bool:
        return all(map(numeric, item)) if isinstance(item, list) else is_number(item)

    if not numeric(raw):
        return None
    try:
        return np.array(raw, dtype=float)
    except ValueError:  # rows of unequal length
        return None
