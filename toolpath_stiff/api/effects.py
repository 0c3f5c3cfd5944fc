"""The physical effects that a machine can have: the catalogue's and one's own."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from toolpath_stiff.api.inputs import template
from toolpath_stiff.api.machines import Machine, machine_from
from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.file import KINDS
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.options import Option, checked
from toolpath_stiff.results import TextFile
from toolpath_stiff.stiffness.catalogue import EffectCatalogue, effects_from_file, known_effects
from toolpath_stiff.stiffness.trial import EffectCheck, try_effect


@checked
def effects(
    files: Iterable[str | Path] = (),
    *,
    kind: Annotated[str, Option("--kind", choices=tuple(KINDS))] = Hexapod.kind,
) -> EffectCatalogue:
    """The effects that a machine can carry: the catalogue's, and those in files of one's own.

    Parameters
    ----------
    files
        Files with effects of one's own.
    kind
        Kind of machine that the effects apply to.

    Raises
    ------
    InputError
        A file cannot be loaded.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.effects()["weak_strut"].title
    'one strut is weak'
    """
    return EffectCatalogue(list(known_effects(list(map(str, files)), kind).values()))


def check_effects(file: str | Path, machine: Machine | str | Path = "nist") -> EffectCheck:
    """Try the effects of a file against the contract, on a machine.

    Raises
    ------
    InputError
        The file cannot be loaded, or names an effect that there is already.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = tps.effect_template("my_screw").save(pathlib.Path(folder, "my_screw.py"))
    ...     tps.check_effects(file).passed
    True
    """
    on = machine_from(machine)
    known_effects([str(file)], on.stated.kind)  # refuses names that are taken
    trials = {name: try_effect(effect, on.stated) for name, effect in effects_from_file(str(file)).items()}
    return EffectCheck(str(file), on.name, trials)


def effect_template(name: str) -> TextFile:
    """A commented, working example of an effect to change into one's own.

    Parameters
    ----------
    name
        Name of the effect, and of its file without the ending.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> tps.effect_template("my_screw").name
    'my_screw'
    """
    if not name.isidentifier():
        raise InputError(f"{name!r} cannot be an effect's name", expected="a name such as my_screw")
    return TextFile(name, template("effect.py").replace("EFFECT_NAME", name).replace("EFFECT_FILE", f"{name}.py"))


def effect_name(file: str | Path, ending: str = ".py") -> str:
    """The name of the effect to be kept in a file: the file's own, without the ending."""
    path = Path(file)
    if path.suffix != ending or not path.stem.isidentifier():
        raise InputError(f"{str(file)!r} cannot hold an effect", expected=f"a name such as my_screw{ending}")
    return path.stem
