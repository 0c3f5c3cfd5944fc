"""The text of machine files: a template, from LinuxCNC; the geometry that the paper's figures give."""

from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, ClassVar

from toolpath_stiff.correction.geometry import recover_geometry as recover
from toolpath_stiff.correction.geometry import recovery_text
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_bytes
from toolpath_stiff.machine.linuxcnc import machine_from_hal, units_of
from toolpath_stiff.machine.writer import TEMPLATE_REMARK, machine_toml, toml_text
from toolpath_stiff.options import Option, checked
from toolpath_stiff.results import TextFile, TextResult


class MachineFile(TextFile):
    """The text of a machine file.

    Attributes
    ----------
    name, text, notes
        The machine's name; the file; what was assumed in making it.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> template = tps.machine_template("mill.toml")
    >>> template.name, template.to_dict()["notes"]
    ('mill', [])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = template.save(pathlib.Path(folder, "mill.toml"))
    ...     tps.Machine.load(file)
    <Machine mill: 6 struts, no effects>
    """

    command: ClassVar[str] = "machine"

    def __init__(self, name: str, text: str, notes: Sequence[str] = ()) -> None:
        super().__init__(name, text)
        self.notes = list(notes)

    def to_dict(self) -> dict[str, Any]:
        """The text and the notes."""
        return {"machine": self.name, "text": self.text, "notes": self.notes}


def machine_template(file: str | Path = "mine.toml") -> MachineFile:
    """A commented machine file to edit, named after its file; nothing is written before `save`.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_template("mill.toml").name
    'mill'
    """
    target = Path(file)
    text = (resources.files("toolpath_stiff") / "data" / "templates" / "machine.toml.txt").read_text("utf-8")
    text = text.replace('"MACHINE_NAME"', toml_text(target.stem)).replace("MACHINE_FILE", target.name)
    return MachineFile(target.stem, text.replace("REMARK", TEMPLATE_REMARK))


@checked
def machine_from_linuxcnc(
    file: str | Path, units: Annotated[str | None, Option("--units", choices=("mm", "inch"))] = None
) -> MachineFile:
    """The machine of the genhexkins pins in a LinuxCNC HAL file.

    Parameters
    ----------
    file
        The HAL file.
    units
        Of the pins, "mm" or "inch"; unless given, LINEAR_UNITS of the ini file beside it.

    Raises
    ------
    InputError
        The file cannot be read, lacks pins, or nobody says the unit.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_from_linuxcnc("nowhere.hal")
    Traceback (most recent call last):
    toolpath_stiff.errors.FileError: cannot read the file of HAL pins 'nowhere.hal': No such file or directory
    """
    path = Path(file)
    text = read_bytes(path, "the file of HAL pins").decode("utf-8", "replace")
    unit = units or units_of(path)
    if unit is None:
        mistake = "the unit of the pins is not known (no ini file beside it that says LINEAR_UNITS)"
        raise InputError(mistake, hint="give it with --units mm or --units inch", file=str(file))
    machine, notes = machine_from_hal(text, unit, path.name)
    heading = f"Made from {path.name}, pins in {unit}.\n" + "\n".join(notes)
    return MachineFile(machine.name, machine_toml(machine, heading), notes)


@checked
def recover_geometry(
    *,
    starts: Annotated[int, Option("--starts", at_least=1, at_most=1000)] = 20,
    seed: Annotated[int, Option("--seed", at_least=0)] = 1,
) -> TextResult:
    """Fit the NIST geometry to the paper's Table 1 anew, from scattered starting points.

    Parameters
    ----------
    starts
        How many starting points.
    seed
        Of where they lie.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> found = tps.recover_geometry(starts=1)
    >>> found.to_dict()["starts"]
    1
    """
    recovery = recover(starts=starts, seed=seed)
    return TextResult(recovery_text(recovery), dict(recovery), f"the NIST geometry from {starts} starts")
