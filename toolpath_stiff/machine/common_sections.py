"""Sections that any kind of machine file may have: names, `[setup]`, effects, `[uncertainty]`."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from toolpath_stiff import defaults
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.machine.schema import MachineToml, Sections
from toolpath_stiff.machine.uncertainty import read_uncertainty
from toolpath_stiff.poses import pose_in_si
from toolpath_stiff.toml_reader import shortened
from toolpath_stiff.units import m_per_s_from_mm_per_min


def common_fields(toml: MachineToml, values: Sections, parameters: Sequence[str] = ()) -> dict[str, Any]:
    """Arguments of a `MachineTool`; `parameters`: names that `[uncertainty]` may use besides those of effects."""
    top, setup = {"title": values[""]["name"], "source": "", **values[""]}, values.get("setup", {})
    effects, instruments = (_entries(toml, kind) for kind in ("effect", "instrument"))
    return {
        **{key: top[key] for key in ("name", "title", "source")},
        "default_origin": pose_in_si(setup.get("default_origin_mm", np.zeros(3))),
        "rapid_feed": m_per_s_from_mm_per_min(setup["rapid_mm_per_min"]) if setup else defaults.RAPID_FEED,
        "setup": setup.get("name"),
        "temperature": setup.get("temperature_C"),
        "setups": setup.get("names", ()),
        "origins": {name: v["origin"] for name, v in values.items() if name and "origin" in v},
        "remarks": {name: v["remark"] for name, v in values.items() if name and "remark" in v},
        "effects": effects,
        "instruments": instruments,
        "uncertainty": read_uncertainty(toml, parameters, (*effects, *instruments)),
    }


def _entries(toml: MachineToml, kind: str) -> tuple[EffectEntry, ...]:
    """`[[effect]]` and `[[instrument]]`: name, parameters in SI, provenance if given.

    What the parameters mean, and their bounds, is known to the effects themselves (the room above).
    """
    entries = []
    for nth, row in enumerate(toml.rows(kind)):
        places = {key: toml.line_of(kind, key, nth) for key in ("", *row)}
        lines = {key: line for key, line in places.items() if line is not None}
        name, provenance = row.get("name"), row.get("provenance", {})
        key, mistake, expected = "", "", ""
        if not isinstance(name, str) or not name:
            key, expected = "name", "an effect's name"
            mistake = " is missing" if name is None else f" = {name!r}"
        elif not isinstance(provenance, dict):
            key, mistake, expected = "provenance", f" = {shortened(provenance)}", f"a table [{kind}.provenance]"
        if key:
            text, line = f"[[{kind}]] {key}{mistake}", lines.get(key, lines.get(""))
            raise InputError(text, expected=expected, file=toml.file, line=line)
        parameters = {key: value for key, value in row.items() if key not in ("name", "provenance")}
        entries.append(EffectEntry(str(name), parameters, provenance, toml.file, lines))
    return tuple(entries)
