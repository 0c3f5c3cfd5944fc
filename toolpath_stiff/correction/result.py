"""The result of an update: the steps, what the data support of them, and the machine that came of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from toolpath_stiff.correction import words
from toolpath_stiff.correction.document import document_of, rounded_step
from toolpath_stiff.correction.outcome import UpdateOutcome
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import Content, write_atomically
from toolpath_stiff.machine.model import Hexapod
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.results import FolderResult

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False, repr=False)
class Update(UpdateOutcome, FolderResult):
    """A machine's model corrected by measurements, or why it was not.

    Attributes
    ----------
    inputs
        Files that must not be written over.
    opened
        Makes what users call a machine of the new one.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> update = tps.update("nist-table1", "nist", strut_law=True, noise_percent=5)
    >>> update
    <Update: updated, mean error 9.62 to 9.67 %>
    >>> update.accepted, update.to_dict()["objective"]
    (True, 'likelihood')
    >>> update.to_frame()["mean_abs_error_percent"].round(2).tolist()
    [9.62, 9.67]
    >>> print(update.machine_text().splitlines()[0][:24])
    # Machine nist, updated.
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = update.save_machine(pathlib.Path(folder, "mine.toml"))
    ...     tps.Machine.load(file).name == update.machine.name
    True
    >>> print(update.next[0])
    what is left:
    tps compare nist-table1 --machine machine.toml --noise 5
    >>> list(update.files(plots=False)), type(update.plot()).__name__
    (['update.json', 'residuals.csv', 'machine.toml'], 'Figure')
    """

    command: ClassVar[str] = "update"
    shown_by: ClassVar[str] = "update"

    inputs: tuple[str, ...] = ()
    opened: Callable[[Hexapod], Any] | None = None

    @property
    def machine(self) -> Any:
        """The machine that carries what was added; raises `InputError` where it was refused."""
        machine = self._corrected()
        return machine if self.opened is None else self.opened(machine)

    def _corrected(self) -> Hexapod:
        if self.corrected is None:
            hint = "" if self.worse else "force=True keeps it all the same"
            raise InputError(f"the update was refused: {words.text(self)}", hint=hint)
        return self.corrected

    @cached_property
    def document(self) -> Document:
        """The content of update.json."""
        return document_of(self)

    def to_dict(self) -> dict[str, Any]:
        """The content of update.json."""
        return dict(self.document)

    def to_frame(self) -> pd.DataFrame:
        """The steps, one a row: as given, strut law refitted, each effect; errors in per cent."""
        import pandas as pd

        return pd.DataFrame([rounded_step(self, k) for k in range(len(self.steps))])

    def _short(self) -> str:
        first, last = (100.0 * step.error for step in (self.steps[0], self.steps[-1]))
        return f"{self.verdict}, mean error {first:.2f} to {last:.2f} %"

    def machine_text(self) -> str:
        """The new machine file, with where its fitted values come from; raises `InputError` where it was refused."""
        return machine_toml(self._corrected(), words.machine_heading(self))

    def save_machine(self, file: str | Path) -> Path:
        """Write the new machine file, whole or not at all."""
        return write_atomically(file, self.machine_text())

    def files(self, *, plots: bool = True, machine: bool = True) -> Mapping[str, Content | Callable[[], Content]]:
        """The files of `tps update`; the machine file too, unless it is said not."""
        none = {"machine.toml": machine and self.accepted, "figure3.csv": self.bars is not None}
        return self._files(plots, [name for name, there in none.items() if not there])
