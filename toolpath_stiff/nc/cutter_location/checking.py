"""`tps check` of a cutter-location file: it goes on where the reader would stop."""

from __future__ import annotations

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.cutter_location import vocabulary
from toolpath_stiff.nc.cutter_location.program import NO_CUT
from toolpath_stiff.nc.cutter_location.reading import CutterLocation
from toolpath_stiff.nc.tables import ToolEntry


class CheckedCutterLocation(CutterLocation):
    """A cutter-location file read with all its errors.

    `errors` are those found; `used` are words to the line where they stand first and how often.
    """

    def __init__(self, name: str, tools: dict[int, ToolEntry] | None, most_errors: int) -> None:
        super().__init__(name, tools)
        self.errors: list[InputError] = []
        self.used: dict[str, list[int]] = {}
        self.start = self.state()
        self._most = most_errors

    def check(self, lines: tuple[str, ...]) -> None:
        """Read all lines."""
        try:
            self.run(lines, self._note_error)
        except InputError as error:
            if error not in self.errors:
                self.errors.append(error)
        if not self.errors and not self.recorder.cuts:
            self.errors.append(InputError(NO_CUT, expected="GOTO/ after FEDRAT/, not after RAPID", file=self.name))

    def _note_error(self, error: InputError) -> None:
        self.errors.append(error)
        if len(self.errors) >= self._most:
            raise error

    def seen(self, word: str, line: int) -> None:
        """Count a word."""
        if word in self.used:
            self.used[word][1] += 1
        elif word:
            self.used[word] = [line, 1]

    def meanings(self) -> list[tuple[str, str, int, int]]:
        """Words used: word, meaning, first line, count."""
        return [(word, vocabulary.meaning(word), line, count) for word, (line, count) in self.used.items()]

    def state(self) -> dict[str, str]:
        """What is in force."""
        i, j, k = self.next_axis
        feed = "none" if self.feed is None else f"{self.feed:g} mm/{'rev' if self.per_revolution else 'min'}"
        return {
            "units": "mm" if self.scale == 1.0 else "inch",
            "tool axis": f"{i:g} {j:g} {k:g}",
            "MULTAX": {None: "not said", True: "on", False: "off"}[self.multax],
            "feed": feed,
            "spindle": f"{self.speed:g} rpm",
            "tool": str(self.tool),
            "tool length": "reference" if self.tool_length != self.tool_length else f"{self.tool_length:g} mm",
            "cycle": "off" if self.cycle is None else "on",
        }
