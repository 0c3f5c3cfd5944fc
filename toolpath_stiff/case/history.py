"""The steps of a case, done and undone, and the files that they wrote."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import Any, TypeVar, cast

from toolpath_stiff.case.files import free_name, sha256, used_name, without_lines, write_files
from toolpath_stiff.case.steps import CASE_FILE, TABLES, CaseState, Step, case_text
from toolpath_stiff.documents import Document
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import write_atomically

Method = TypeVar("Method", bound=Callable[..., Any])


def python_line(name: str, positional: Sequence[Any], named: Document) -> str:
    """A call of a method of the case; without what only watches it."""
    words = {"": positional, **{f"{key}=": [value] for key, value in named.items() if key != "progress"}}
    shown = [
        f"{key}{str(value) if isinstance(value, Path) else value!r}"
        for key, values in words.items()
        for value in values
        if not callable(value)
    ]
    return f"case.{name}({', '.join(shown)})"


def recorded(method: Method) -> Method:
    """The method; the step that it records has its call as the Python line."""

    @wraps(method)
    def call(self: History, *args: Any, **named: Any) -> Any:
        outer, self._call = self._call, python_line(method.__name__, args, named)
        try:
            return method(self, *args, **named)
        finally:
            self._call = outer

    return cast("Method", call)


class History:
    """The steps of a case and the files that they wrote.

    Attributes
    ----------
    folder
        Where the case is.
    sent_to
        A folder that the Python lines leave out, with its last "/": where files lie that a page has sent.
    """

    sent_to = ""
    _call = ""  # the method that is at work, as a Python line

    def __init__(self, folder: Path, steps: Sequence[Step], done: int, text: str) -> None:
        self.folder, self._steps, self._done, self._written = folder, list(steps), done, text

    @property
    def history(self) -> list[Step]:
        """The steps that hold."""
        return self._steps[: self._done]

    @property
    def undone(self) -> list[Step]:
        """The steps that redo would bring back, the next one first."""
        return self._steps[self._done :]

    @property
    def state(self) -> CaseState:
        """What holds now."""
        state = CaseState()
        for step in self.history:
            state = replace(state, **step.change)
        return state

    def path(self, name: str) -> str:
        """A file of the case, as functions and commands take it."""
        return str(self.folder / name)

    def undo(self) -> Step | None:
        """Take back the last step that changed something, and what was found since; None where there is none."""
        last = next((n for n in range(self._done - 1, 0, -1) if self._steps[n].change), None)
        if last is None:
            return None
        self._done = last
        self._save()
        return self._steps[last]

    def redo(self) -> Step | None:
        """Do again the next step that was undone, and what was found after it; None where nothing was."""
        changes = [n for n in range(self._done, len(self._steps)) if self._steps[n].change]
        if not changes:
            return None
        self._done = changes[1] if changes[1:] else len(self._steps)
        self._save()
        return self._steps[changes[0]]

    def record(
        self,
        kind: str,
        text: str,
        command: str = "",
        *,
        change: Document | None = None,
        files: Sequence[str] = (),
        python: str = "",
        result: str = "",
    ) -> None:
        """Add a step and write the case. `files`: those that the step wrote; `python`: unless given, the call at work.

        A step that changes something forgets what was undone; one that only finds something out does not.
        """
        sums = {name: sha256((self.folder / name).read_bytes()) for name in files}
        python = python or self._call
        python = python.replace(self.sent_to, "") if self.sent_to else python
        step = Step(kind, text, command, python, dict(change or {}), sums, result)
        self._steps = [*self.history, step, *(() if change else self.undone)]
        self._done += 1
        self._save()

    def next_result(self, kind: str) -> str:
        """A free folder for a result."""
        return free_name(self.folder, f"results/{len(self.history) + 1:03d}-{kind}")

    def check_files(self) -> None:
        """Raise `InputError` for a file of the case that is gone, or is not what its step wrote."""
        state = self.state
        tables = {str(state.reading[name]) for name in TABLES if name in state.reading}
        needed = {state.machine, state.program, *state.effects, *state.data, *tables}
        for name, known in {name: known for step in self.history for name, known in step.files.items()}.items():
            file = self.folder / name
            if name in needed and (not file.is_file() or sha256(file.read_bytes()) != known):
                what = "is not what was put into the case" if file.is_file() else "is gone"
                raise InputError(f"{name} {what}", hint="bring the file back, or begin another case", file=str(file))

    def _rewrite_used(self, state: CaseState) -> None:
        """Files in used/ as the state has them: after undo and redo too."""
        for file, lines in state.lines_aside.items():
            write_files(self.folder, {used_name(file): without_lines(self.folder / file, lines)})

    def _save(self) -> None:
        file = self.folder / CASE_FILE
        if file.is_file() and file.read_text("utf-8") != self._written:
            raise InputError(
                f"{CASE_FILE} was changed by another program since it was opened", hint="open the case again"
            )
        self._rewrite_used(self.state)
        self._written = case_text(self._steps, self._done)
        write_atomically(file, self._written)
