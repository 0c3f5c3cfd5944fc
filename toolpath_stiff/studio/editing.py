"""Effects of one's own, edited beside the page: working copies, loaded whenever they are saved.

A working copy stands in the case's folder `edit/`, outside the case: it becomes a file of the case, and a step that can
be undone, each time it is saved without a fault. Code is run of those files alone that the user has loaded before.
"""

import threading
from collections.abc import Callable
from pathlib import Path

from toolpath_stiff.case.case import Case
from toolpath_stiff.case.files import first_name, free_name, sha256, write_files
from toolpath_stiff.errors import InputError, TpsError

FOLDER = "edit"


LOOKS_EVERY = 0.5  # s between two looks at the working copies


class Editing:
    """The working copies of a case's own effects.

    Attributes
    ----------
    faults
        File of the case -> what is wrong with its working copy, with its line; "" where nothing is.
    """

    def __init__(self, case: Case) -> None:
        self.case, self.faults = case, dict[str, str]()
        self._open: dict[str, tuple[Path, str]] = {}  # file of the case -> its working copy, and that one's sum
        self._closing = threading.Event()

    def open(self, name: str) -> None:
        """Write the working copy of a file of the case and follow it from now on."""
        if name not in self.case.state.effects:
            raise InputError(f"{name} is no file of own effects of this case")
        content, copy = (
            (self.case.folder / name).read_bytes(),
            free_name(self.case.folder, f"{FOLDER}/{first_name(name)}"),
        )
        write_files(self.case.folder, {copy: content})
        self._open[name], self.faults[name] = (self.case.folder / copy, sha256(content)), ""

    def save(self, name: str, text: str) -> None:
        """Write the working copy as the page has it; `look` loads it."""
        if name not in self._open:
            self.open(name)
        write_files(self.case.folder, {f"{FOLDER}/{self._open[name][0].name}": text})

    def look(self) -> bool:
        """Load every working copy that was saved since the last look; whether there was one."""
        changed = False
        for name in [name for name in self._open if name in self.case.state.effects]:
            file, known = self._open[name]
            try:
                now = sha256(file.read_bytes())
            except OSError:  # an editor that replaces the file is between two steps
                continue
            if now != known:
                self._open[name], changed = (file, now), True
                self._load(name, file)
        return changed

    def _load(self, name: str, file: Path) -> None:
        try:
            self.case.change_effects(name, file)
        except TpsError as error:
            self.faults[name] = str(error).replace(f"{self.case.folder}/", "")
            return
        new = self.case.state.effects[-1]
        self._open[new], self.faults[new] = self._open[name], ""

    def state(self) -> list[dict[str, str]]:
        """The own effects of the case with their text, as the page shows them; `copy`: "" where none is open."""
        files = []
        for name in self.case.state.effects:
            copy = self._open.get(name, (None, ""))[0]
            text = (copy or self.case.folder / name).read_text("utf-8", "replace")
            path = str(copy.resolve()) if copy else ""
            files.append({"file": name, "text": text, "copy": path, "fault": self.faults.get(name, "")})
        return files

    def follow(self, looked: Callable[[], None]) -> None:
        """Call `looked` every half second in a thread until `close`."""

        def run() -> None:
            while not self._closing.wait(LOOKS_EVERY):
                if self._open:
                    looked()

        threading.Thread(target=run, daemon=True).start()

    def close(self) -> None:
        """Stop following."""
        self._closing.set()
