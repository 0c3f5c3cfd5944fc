"""Methods of every result: print, show in a notebook, and convert to table, document, picture, files."""

import html
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, write_atomically
from toolpath_stiff.results_folder import Rules, write_folder

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure  # noqa: PLC0414  (for all results)
    from pandas import DataFrame as DataFrame  # noqa: PLC0414
else:  # both libraries are loaded when the first table or picture is asked for
    DataFrame = Figure = Any


def frame_of(rows: Any, columns: list[str] | None = None) -> DataFrame:
    """Rows or columns as a DataFrame; pandas is loaded with the first one."""
    import pandas as pd

    return pd.DataFrame(rows, columns=columns)


# Called with what is being done, how much of it is done, and how much there is (0: not known).
Progress = Callable[[str, int, int], None]


def _door() -> Any:
    """Entry to views and pictures, which are far above this module in the layers."""
    return import_module("toolpath_stiff.report.folder")


class Result(ABC):
    """Result of a function of this package.

    `print(result)` shows what the command line shows. Figures are in the shop's units, which every name carries.
    """

    command: ClassVar[str] = ""  # the command that gives the same result
    shown_by: ClassVar[str] = ""  # the module of `report` that shows it

    @property
    def view(self) -> Any:
        """Module that makes text, figures and files of the result, imported on first use.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.map_stiffness("nist", points=5).view.__name__
        'toolpath_stiff.report.map'
        """
        return _door().view_of(self.shown_by)

    @abstractmethod
    def to_dict(self) -> Document:
        """The result as plain data: the JSON document that the command writes, and prints with --json.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> sorted(tps.machine_template("mill.toml").to_dict())
        ['name', 'notes', 'text']
        """

    def __str__(self) -> str:
        """The result as text, as a terminal shows it."""
        return str(self.view.text(self))

    @abstractmethod
    def _short(self) -> str:
        """The result in a few words, for `repr`."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self._short()}>"

    def _repr_html_(self) -> str:
        """HTML shown by notebooks."""
        return f"<pre>{html.escape(str(self))}</pre>"

    def to_json(self) -> str:
        """`to_dict()` as text, as the command writes it.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> print(tps.Machine.load("nist").check().to_json()[:37])
        {
          "file": "nist",
          "machine": "nis
        """
        return json_text(self.to_dict())

    def to_frame(self) -> DataFrame:
        """The result as a pandas DataFrame, the unit in each column's name.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> tps.effects().to_frame()["link"].tolist()[:3]
        ['tool', 'tool', 'platform']
        """
        raise self._cannot("has no table", "use to_dict()")

    def plot(self) -> Figure:
        """The result as a matplotlib figure, its first picture.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> figure = tps.map_stiffness("nist", points=5).plot()
        >>> type(figure).__name__
        'Figure'
        """
        return self._figure()

    def _figure(self, name: str = "", **look: Any) -> Figure:
        """A picture of the result; the first unless named."""
        figure: Figure | None = _door().figure(self, name, **look)
        if figure is None:
            raise self._cannot("has no picture", "print it, or use to_dict()")
        return figure

    def _picture(self, **look: Any) -> bytes:
        """A picture of the result as PNG."""
        return bytes(_door().picture(self, **look))

    def _cannot(self, what: str, hint: str) -> InputError:
        return InputError(f"{type(self).__name__} {what}", hint=hint)


class FolderResult(Result):
    """A result that a command writes as a folder of files."""

    inputs: tuple[str, ...] = ()  # files that were read, which must not be written over

    def files(self, *, plots: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """Name -> content (or a function that makes it) of each file that `save` writes; pictures, pages with `plots`.

        Examples
        --------
        >>> import toolpath_stiff as tps
        >>> list(tps.map_stiffness("nist", points=5).files())
        ['map.csv', 'map.json', 'map.png', 'map.html']
        """
        return self._files(plots)

    def _files(
        self, plots: bool, omit: Collection[str] = (), **look: Any
    ) -> Mapping[str, Content | Callable[[], Content]]:
        """Files of the result, except `omit`."""
        return dict(_door().files(self, plots=plots, omit=omit, **look))

    def save(
        self,
        folder: str | Path,
        *,
        plots: bool = True,
        replace: bool = False,
        rules: Rules | None = None,
        **options: Any,
    ) -> list[Path]:
        """Write the files of the command to a folder, all or none; what an earlier run left there is cleared.

        Parameters
        ----------
        folder
            Where to; made if need be.
        plots
            Pictures and pages as well as data.
        replace
            Keep a file that somebody else wrote as NAME.old beside the new one, where it would be in the way; unless
            this is said, nothing is written then.
        rules
            What must not be replaced, in full; wins over `replace`.
        **options
            Further ones of `files`.

        Returns
        -------
        list of Path
            The files written.

        Raises
        ------
        InputError
            A file of such a name is not the tool's, or was read for this result, or the folder cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     written = tps.map_stiffness("nist", points=5).save(folder, plots=False)
        >>> [file.name for file in written]
        ['map.csv', 'map.json']
        """
        return write_folder(
            folder,
            self.files(plots=plots, **options),
            command=self.command,
            rules=rules or Rules(inputs=self.inputs, replace=replace),
        )


class TextFile(Result):
    """The text of a file, a machine's or an effect's, to print and to save.

    Attributes
    ----------
    name, text, notes
        Of the machine or effect; the file; what was assumed in making it.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> template = tps.effect_template("my_screw")
    >>> template.name, template.notes, template.text == str(template)
    ('my_screw', [], True)
    """

    def __init__(self, name: str, text: str, notes: Sequence[str] = ()) -> None:
        self.name, self.text, self.notes = name, text, list(notes)

    def __str__(self) -> str:
        return self.text

    def _short(self) -> str:
        return f"{self.name}, {len(self.text.splitlines())} lines"

    def to_dict(self) -> dict[str, object]:
        """Name, text and notes."""
        return {"name": self.name, "text": self.text, "notes": self.notes}

    def save(self, file: str | Path) -> Path:
        """Write the file, whole or not at all.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> import toolpath_stiff as tps
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     tps.machine_template("mill.toml").save(pathlib.Path(folder, "mill.toml")).name
        'mill.toml'
        """
        return write_atomically(file, self.text)


def json_text(document: Any) -> str:
    """A document as every command writes it: indented, no nan, no infinity, a line feed at the end."""
    return json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def counter(progress: Progress | None, text: str) -> Callable[[int, int], None] | None:
    """Callback for a loop, called with (done, total), that reports to the caller's `progress`."""
    return None if progress is None else lambda done, total: progress(text, done, total)


def teller(progress: Progress | None) -> Callable[[str], None]:
    """Callback for work of unknown length, called with what it is doing, that reports to the caller's `progress`."""
    return (lambda text: None) if progress is None else lambda text: progress(text, 0, 0)


def one_of(name: str, value: str, known: Sequence[str]) -> str:
    """The value, if it is a known one. Raises `InputError`."""
    if value not in known:
        raise InputError(f"{name} {value!r}", expected=f"one of {', '.join(known)}")
    return value
