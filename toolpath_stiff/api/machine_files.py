"""Machine files to be made: templates, and machines converted from other programs' files."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

from toolpath_stiff.api.inputs import template
from toolpath_stiff.files import read_text
from toolpath_stiff.machine import dh_table, freecad, urdf
from toolpath_stiff.machine.file import KINDS
from toolpath_stiff.machine.linuxcnc_files import read_control
from toolpath_stiff.machine.linuxcnc_kinds import MODULES, machine_from_control
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.writer import TEMPLATE_REMARK, toml_text
from toolpath_stiff.options import Option, checked, names
from toolpath_stiff.results import TextFile


@checked
def machine_template(
    file: str | Path = "mine.toml",
    *,
    kind: Annotated[str, Option("--kind", choices=tuple(KINDS))] = Hexapod.kind,
) -> TextFile:
    """A commented machine file to edit, named after its file; nothing is written before `save`.

    Parameters
    ----------
    file
        Name of the file to be.
    kind
        Kind of machine: six telescopic struts, or joints in series, five struts, a linear or rotary delta, struts on
        moving feet.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_template("mill.toml").name
    'mill'
    """
    target = Path(file)
    name = "machine" if kind == Hexapod.kind else kind
    text = (
        template(f"{name}.toml").replace('"MACHINE_NAME"', toml_text(target.stem)).replace("MACHINE_FILE", target.name)
    )
    return TextFile(target.stem, text.replace("REMARK", TEMPLATE_REMARK))


@checked
def machine_from_linuxcnc(
    file: Annotated[str | Path, Option("FILE.hal|FILE.ini")],
    units: Annotated[str | None, Option("--units", choices=("mm", "inch"))] = None,
) -> TextFile:
    """The machine of the kinematics pins in LinuxCNC's HAL and ini files; compliances are left to fill in.

    Modules: trivkins, 5axiskins, xyzac-trt-kins, xyzbc-trt-kins, genserkins, pumakins, genhexkins, pentakins,
    lineardeltakins, rotarydeltakins.

    Parameters
    ----------
    file
        The HAL file, with the ini files beside it that load it, or the ini file, with the HAL files that it loads.
    units
        Unit of the pins, "mm" or "inch"; unless given, LINEAR_UNITS of the ini file beside it.

    Raises
    ------
    InputError
        The file cannot be read, lacks pins, or nobody says the unit.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_from_linuxcnc("nowhere.hal")
    Traceback (most recent call last):
    toolpath_stiff.errors.InputError: cannot read the file of HAL pins 'nowhere.hal': No such file or directory
    """
    path = Path(file)
    return TextFile(path.stem, *machine_from_control(read_control(path, MODULES, units), path.stem))


@checked
def machine_from_urdf(
    file: Annotated[str | Path, Option("FILE.urdf")], tip: Annotated[str, Option("--tip", "LINK")]
) -> TextFile:
    """The robot of a URDF file, from its root link to a tip link; compliances are left to fill in.

    Parameters
    ----------
    file
        The URDF file.
    tip
        The link at the tip of the tool, with z towards the shank; or a flange, if you add the tool by hand.

    Raises
    ------
    InputError
        Not a chain, limits that are missing, units that cannot be.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_from_urdf("nowhere.urdf", "flange")
    Traceback (most recent call last):
    toolpath_stiff.errors.InputError: cannot read the URDF file 'nowhere.urdf': No such file or directory
    """
    path = Path(file)
    return TextFile(path.stem, *urdf.machine_from_urdf(read_text(path, "the URDF file"), tip, path.name))


@checked
def machine_from_dh(
    file: Annotated[str | Path, Option("TABLE")],
    convention: Annotated[str, Option("--convention", choices=("modified", "standard"))],
) -> TextFile:
    """The robot of a table of Denavit-Hartenberg rows; compliances are left to fill in.

    Parameters
    ----------
    file
        Columns alpha_deg, a_mm, d_mm, offset_deg, min_deg, max_deg and, if there, name and type (R, or P with min_mm,
        max_mm).
    convention
        Convention of the rows: modified (Craig) or standard; the rows do not show it.

    Raises
    ------
    InputError
        A cell that is no number, a limit that is missing.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_from_dh("nowhere.csv", "modified")
    Traceback (most recent call last):
    toolpath_stiff.errors.InputError: cannot read DH rows 'nowhere.csv': No such file or directory
    """
    name = Path(str(file)).stem
    return TextFile(name, *dh_table.machine_from_dh(str(file), name, f"{convention} DH"))


@checked
def machine_from_freecad(
    file: Annotated[str | Path, Option("FILE.fcm")],
    order: Annotated[Sequence[str], Option("--order", "X,Y,...", read=names)] = (),
) -> TextFile:
    """The mill of a FreeCAD machine (.fcm); compliances are left to fill in.

    Parameters
    ----------
    file
        The machine.
    order
        Axes from the base outwards, if the file does not give their order.

    Raises
    ------
    InputError
        Not a machine, an order that nobody says, mirrored axes.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.machine_from_freecad("nowhere.fcm")
    Traceback (most recent call last):
    toolpath_stiff.errors.InputError: cannot read the FreeCAD machine 'nowhere.fcm': No such file or directory
    """
    path = Path(file)
    return TextFile(path.stem, *freecad.machine_from_fcm(read_text(path, "the FreeCAD machine"), order, path.name))
