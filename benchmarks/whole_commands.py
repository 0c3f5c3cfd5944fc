"""CPU time of whole commands as a user gives them, beside that of Python with numpy."""

from __future__ import annotations

import shutil
import statistics
import sys
import tempfile
from pathlib import Path

from benchmarks.diagnosis_size import COMMANDS, campaign
from benchmarks.pages import bar, table
from benchmarks.processes import whole_command, whole_process

PROGRAM = Path(__file__).parents[1] / "programs" / "pocket.nc"
BOUNDS = ("--x", "-300:300", "--y", "-300:300", "--z", "400:1250")  # as in the README
READINGS = 288
# Words of a command, what the table calls it, CPU seconds that it may take.
ROWS = (
    (("--help",), "`tps --help`", 0.15),
    (("analyze", "pocket.nc", "--no-plots"), "`tps analyze pocket.nc --no-plots`, 560 poses", 0.2),
    (("place", "pocket.nc", *BOUNDS), "`tps place pocket.nc` in the README's bounds, all files", 3.0),
    (("diagnose", "readings.csv", *COMMANDS["diagnose"]), f"`tps diagnose`, {READINGS} readings, all files", 3.0),
    (("update", "readings.csv", *COMMANDS["update"]), f"`tps update`, {READINGS} readings, all files", 2.0),
)


def measure_commands(rounds: int) -> tuple[list[str], bool]:
    """Lines of the table, and whether all bars are cleared."""
    empty = statistics.median(whole_process([sys.executable, "-c", "import numpy"])[0] for _ in range(2 * rounds))
    rows, passed = [], True
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(PROGRAM, folder)
        (Path(folder) / "readings.csv").write_text(campaign(READINGS))
        for words, label, most in ROWS:
            whole_command(list(words), folder, (0, 1))
            median = statistics.median(whole_command(list(words), folder, (0, 1))[0] for _ in range(rounds))
            passed &= median <= most
            rows.append((label, f"{median:.2f}", f"{median / empty:.1f}", bar(median <= most, f"at most {most:g}")))
    return [
        f"Python with numpy and nothing else takes {empty:.3f} s.",
        "",
        *table("command | CPU seconds, median: | times Python with numpy: | bar", rows),
    ], passed
