"""Machine files: TOML in shop units to a machine in SI, checked key by key (`schema`), each kind by its own reader.

A key that is not known is an error, so that a typing mistake cannot fall back to a default; the message has section,
key, value and bound.
"""

import os
from copy import deepcopy
from dataclasses import replace
from functools import cache
from importlib import import_module
from pathlib import Path

from toolpath_stiff import defaults
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_utf8
from toolpath_stiff.hints import command_line
from toolpath_stiff.machine.limits import upright_middle
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.machine.schema import MachineToml
from toolpath_stiff.toml_reader import LARGEST_BYTES, shortened

# Value of `kind` in a machine file -> module whose `read` reads such files, imported when needed.
KINDS = {
    "hexapod": "hexapod_file",
    "serial": "serial_file",
    "delta": "delta",
    "rotary_delta": "rotary_delta",
    "pentapod": "pentapod",
    "hexaglide": "hexaglide",
}
ALIASES = {"linear_delta": "delta"}


def packaged_machines() -> dict[str, Path]:
    """Name -> file of each machine that ships with the package."""
    folder = Path(__file__).parent.parent / "data" / "machines"
    return {path.stem: path for path in sorted(folder.glob("*.toml"))}


def load_machine(name_or_file: str | Path = defaults.MACHINE) -> MachineTool:
    """Load a machine by the name of a packaged one or from a machine file.

    Parameters
    ----------
    name_or_file
        A name that `packaged_machines` lists, or a path to a TOML file.

    Raises
    ------
    InputError
        There is no such machine or file, or the file is wrong; the message has section, key, value, bound.

    Examples
    --------
    >>> machine = load_machine("nist")
    >>> machine.name, machine.frame_joints.shape
    ('nist', (6, 3))
    >>> round(machine.reference_tool_length, 5)
    0.15
    """
    known = packaged_machines()
    if str(name_or_file) in known:
        return deepcopy(_packaged(known[str(name_or_file)]))  # a copy: the arrays belong to the caller
    path = Path(name_or_file)
    if not os.path.lexists(path):
        template = command_line("machine", "new", path.with_suffix(".toml") if path.name else "mine.toml")
        raise InputError(
            f"machine {str(name_or_file)!r} is neither a packaged machine nor a file",
            expected=f"one of {', '.join(known)}, or a machine file",
            hint=f"`tps machine list` lists the machines, `{template}` writes a commented template",
        )
    return parse_machine(read_utf8(path, "the machine file", LARGEST_BYTES), file=str(path))


@cache
def _packaged(path: Path) -> MachineTool:
    """A machine that ships with the package, read once."""
    return parse_machine(path.read_text(encoding="utf-8"), file=path.name)


def parse_machine(text: str, file: str = "machine.toml") -> MachineTool:
    """Parse the text of a machine file; `file` is only used in messages. Raises `InputError`."""
    toml = MachineToml(text, file, kind=InputError)
    kind = toml.data.get("kind", Hexapod.kind)
    kind = ALIASES.get(str(kind), kind)
    if not isinstance(kind, str) or kind not in KINDS:
        raise toml.fault("", "kind", f" = {shortened(kind)}", expected=f"one of {', '.join(KINDS)}")
    machine: MachineTool = import_module(f"toolpath_stiff.machine.{KINDS[kind]}").read(toml)
    if isinstance(machine, Hexapod):
        return machine
    if "setup" not in toml.data:
        remark = "not in the file; program zero is put far from all limits, tool upright"
        machine = machine.with_changes(
            default_origin=upright_middle(machine),
            origins={**machine.origins, "setup": "assumed"},
            remarks={**machine.remarks, "setup": remark},
        )
    return machine.with_changes(text=text, limits=replace(machine.limits, neutral_pose=machine.default_origin))
