"""Physical effects along the load path, one flat file each; `contract` defines what an effect is.

Which effects there are: the packaged ones and those of a user's files.
"""

import difflib
import pkgutil
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache, lru_cache
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import ClassVar

from toolpath_stiff.errors import EffectError, InputError
from toolpath_stiff.hints import command_line, options
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.results import DataFrame, Result, frame_of
from toolpath_stiff.stiffness import effects, element_effects
from toolpath_stiff.stiffness.contract import LINKS, Effect
from toolpath_stiff.stiffness.declarations import check_declarations
from toolpath_stiff.stiffness.effect_source import line_in, line_of
from toolpath_stiff.stiffness.term_file import effects_of_terms

MOST_FILES = 64  # files and versions kept loaded: every save in an editor is a version


@cache
def packaged_effects() -> dict[str, Effect]:
    """Name -> effect, for the packaged files, one effect each."""
    return _effects_below(effects)


@cache
def effects_of_elements() -> dict[str, Effect]:
    """Name -> packaged effect that applies to machines of elements."""
    of_both = {name: effect for name, effect in packaged_effects().items() if effect.holds_for == "all"}
    return of_both | _effects_below(element_effects)


def _effects_below(package: ModuleType) -> dict[str, Effect]:
    packaged: dict[str, Effect] = {}
    for module in sorted(module.name for module in pkgutil.iter_modules(package.__path__)):
        packaged |= _effects_in(import_module(f"{package.__name__}.{module}"), module)
    return packaged


def known_effects(files: Iterable[str | Path] = (), kind: str = Hexapod.kind) -> dict[str, Effect]:
    """Name -> effect that applies to a kind of machine, packaged or from the files, sorted along the load path.

    Raises
    ------
    InputError
        A file cannot be loaded, holds no effect, or names one that exists already.
    """
    of_struts = kind == Hexapod.kind
    known = dict(packaged_effects() if of_struts else effects_of_elements())
    others = "elements" if of_struts else "hexapods"
    for file in files:
        for name, effect in effects_from_file(file).items():
            if name in known:
                line = None if effect.file else line_of(type(effect), "name")
                raise EffectError(f"effect {name} exists already", file=str(file), line=line)
            if effect.holds_for != others:
                known[name] = effect
    return dict(sorted(known.items(), key=lambda item: (LINKS.index(item[1].link), item[0])))


def find_effect(name: str, files: Iterable[str | Path] = ()) -> Effect:
    """Effect by name. Raises `InputError` with the nearest name if there is none."""
    files = list(files)
    known = known_effects(files, "elements") | known_effects(files)
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1)
        listed = f"`{command_line('effects', 'list', *options(effects=files))}` lists them"
        raise EffectError(f"unknown effect {name!r}", hint=f"did you mean {near[0]}?" if near else listed)
    return known[name]


def effects_from_file(file: str | Path) -> dict[str, Effect]:
    """Name -> effect of a file: the `Effect` subclasses that a Python file defines, or the terms of a TOML file.

    Read once as long as it does not change.

    Raises
    ------
    InputError
        There is no such file, it fails when it is run (with the line), or what it declares is wrong.
    """
    path = Path(file)
    if not path.is_file():
        new = path.suffix == ".py" and not path.exists()
        hint = f"`{command_line('effects', 'new', path)}` writes one" if new else ""
        raise EffectError(f"no effects file {str(file)!r}", hint=hint)
    state = path.stat()
    return _loaded(str(file), path.resolve(), state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=MOST_FILES)
def _loaded(file: str, path: Path, changed: int, size: int) -> dict[str, Effect]:
    """Effects of a file; `path`, `changed` and `size` distinguish files and their versions."""
    if path.suffix == ".toml":
        return effects_of_terms(file)
    if path.suffix != ".py":
        raise EffectError("neither Python nor TOML", expected="a name that ends in .py or .toml", file=file)
    module = ModuleType(f"toolpath_stiff_user_effects_{path.stem}")
    module.__file__, sys.modules[module.__name__] = str(path), module
    try:  # compile the file's text: a compiled file beside it may be anybody's and differ
        exec(compile(path.read_bytes(), str(path), "exec"), vars(module))
        effects_there = _effects_in(module, file)
    except InputError:
        raise
    except (Exception, SystemExit) as error:  # a user's file may raise anything
        what, line = f"{type(error).__name__}: {error}".rstrip(": "), line_in(error, file)
        if isinstance(error, SyntaxError) and error.filename == str(path):
            what, line = f"{type(error).__name__}: {error.msg}", error.lineno
        raise EffectError(f"{what}, when the file is run", file=file, line=line) from None
    if not effects_there:
        expected = "a class derived from toolpath_stiff.stiffness.effects.Effect"
        raise EffectError("defines no effect", expected=expected, file=file)
    return effects_there


def _effects_in(module: ModuleType, where: str) -> dict[str, Effect]:
    """Effects that a module itself defines."""
    defined: dict[str, Effect] = {}
    for value in vars(module).values():
        if isinstance(value, type) and issubclass(value, Effect) and value.__module__ == module.__name__:
            effect = value()
            check_declarations(effect, where)
            if effect.name in defined and type(defined[effect.name]) is not value:
                raise EffectError(f"effect {effect.name} is defined twice", file=where, line=line_of(value, "name"))
            defined[effect.name] = effect
    return defined


@dataclass(frozen=True, repr=False, eq=False)
class EffectCatalogue(Result):
    """Effects, in the order of the load path.

    Attributes
    ----------
    effects
        The effects themselves.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> catalogue = tps.effects()
    >>> catalogue["weak_strut"].link
    'struts'
    >>> catalogue.to_frame().columns.tolist()
    ['link', 'name', 'title', 'equation', 'source', 'load_dependent']
    >>> len(catalogue.to_dict()["effects"]) == len(catalogue.effects)
    True
    """

    command: ClassVar[str] = "effects"
    shown_by: ClassVar[str] = "effects"

    effects: list[Effect]

    def __getitem__(self, name: str) -> Effect:
        """An effect by its name."""
        return next(effect for effect in self.effects if effect.name == name)

    def to_dict(self) -> dict[str, object]:
        """Declarations of each effect, in its own units."""
        return {"effects": [self.view.describe_effect(effect) for effect in self.effects]}

    def to_frame(self) -> DataFrame:
        """One row per effect: link of the load path, name, title, equation, source."""
        return frame_of(self.to_dict()["effects"])[["link", "name", "title", "equation", "source", "load_dependent"]]

    def _short(self) -> str:
        return f"{len(self.effects)} effects"
