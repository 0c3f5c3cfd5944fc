"""Labels of Siemens' language: jumps, CASE, and the repetition of sections.

SIEMENS, SINUMERIK 840D sl, Programming Manual Job Planning, "Flexible NC programming", "Program section repetition".
"""

import re

from toolpath_stiff.nc.parametric.run import ParametricRun
from toolpath_stiff.nc.parametric.statements import Steering
from toolpath_stiff.nc.run_records import Subprogram
from toolpath_stiff.nc.siemens.expressions import SiemensScanner
from toolpath_stiff.nc.siemens.words import chosen

SECTION = re.compile(r"(REPEATB?)\s+(\w+)(?:\s+(?!P\s*=)(\w+))?", re.ASCII)


class LabelRun(ParametricRun):
    """A run that goes to labels; `_begins`, `_labels` and `_ends` are those of its lines."""

    _begins: list[re.Match[str]]
    _labels: dict[str, list[int]]
    _ends: set[int]

    def _scanner(self, row: int, begin: int) -> SiemensScanner:
        raise NotImplementedError

    def _to_label(self, row: int, way: str, label: str) -> int:
        """The line of a label: forward (GOTOF), backward (GOTOB), backward first (REPEAT), or forward first (GOTO)."""
        first = max((begin for begin in self._ends if begin <= row), default=0)
        stop = min((end for end in self._ends if end > first), default=len(self.lines))
        rows = [place for place in self._labels.get(label, []) if first <= place < stop]
        ahead, behind = [place for place in rows if place > row], [place for place in rows[::-1] if place <= row]
        places = {"GOTOF": ahead, "GOTOB": behind, "REPEAT": behind + ahead}.get(way, ahead + behind)
        if not places:
            raise self._fail(row, f"{way} {label}: the program has no such label there", "LABEL: before a block")
        to = places[0]
        while self._levels and self._levels[-1].stop >= 0 and not self._levels[-1].first <= to < self._levels[-1].stop:
            self._levels.pop()
        return to

    def _jump_to(self, row: int, steering: Steering) -> int | None:
        way, label = steering.label.split()
        stays = (steering.values and not self._value(steering)) or (way == "GOTOC" and label not in self._labels)
        return None if stays else self._to_label(row, way, label)

    def _case(self, row: int, steering: Steering) -> int | None:
        way = chosen(self._scanner(row, self._begins[row].end()))
        return self._to_label(row, *way) if way else None

    def _section(self, row: int, steering: Steering) -> int | None:
        """REPEAT, REPEATB: run the blocks from a label on again."""
        scanner = self._scanner(row, self._begins[row].end())
        section = SECTION.match(scanner.text, scanner.position)
        assert section is not None
        scanner.position = section.end()
        times = scanner.times()
        scanner.refuse_if(not scanner.done, f"{scanner.rest()} behind {steering.shown}", "REPEAT LABEL P=2")
        if not times:
            return None
        first = self._to_label(row, "REPEAT", section[2])
        if section[3] or section[1] == "REPEATB":
            stop = (self._to_label(first, "GOTO", section[3]) if section[3] else first) + 1
        elif first < row:
            stop = next((end for end in self._labels.get("ENDLABEL", []) if first < end < row), row)
        else:
            stop = self._to_label(first, "GOTOF", "ENDLABEL")
        self._begin(Subprogram(section[2], first, row + 1, times - 1, stop=stop), row, steering.column)
        return first
