"""CPU time of many small programs in one command, against the analyses themselves in one process."""

from __future__ import annotations

import statistics
import sys
import tempfile
from pathlib import Path

from benchmarks.pages import bar, table
from benchmarks.processes import whole_process

PROGRAMS, WITH_PICTURES = 2000, 200
BAR = 1.2  # times the CPU of the analyses
PICTURES_BAR = 0.15  # s of CPU a program for two pictures and a page
THEMSELVES = """
import sys
from pathlib import Path
import toolpath_stiff as tps
machine = tps.Machine.load("nist")
for file in sorted(Path("programs").iterdir()):
    tps.analyze(tps.Program.read(file), machine).save(Path("alone", file.stem), plots=False)
"""


def write_programs(folder: Path, count: int) -> None:
    """Small plain programs, no two alike: a frame in two depths, about 400 mm of cuts."""
    folder.mkdir()
    for i in range(count):
        x, y = 40 + i % 30, 40 + i % 23
        frame = f"X{x}\nY{y}\nX0\nY0\n"
        text = f"G21 G90 F1000\nG0 X0 Y0 Z5\nG1 Z-1\n{frame}G1 Z-2\n{frame}G0 Z50\nM2\n"
        (folder / f"part{i:04}.nc").write_text(text)


def measure_many(rounds: int, programs: int = PROGRAMS) -> tuple[list[str], bool]:
    """Lines of the table, and whether the bar is cleared."""
    alone = [sys.executable, "-c", THEMSELVES]
    command = [sys.executable, "-m", "toolpath_stiff", "analyze", "programs", "--jobs", "1", "--no-plots"]
    ratios, seconds = [], []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            write_programs(Path(folder) / "programs", programs)
            seconds.append(whole_process(alone, folder)[0])
            ratios.append(whole_process(command, folder)[0] / seconds[-1])
    ratio, clears = statistics.median(ratios), statistics.median(ratios) <= BAR
    name = f"`tps analyze FOLDER --jobs 1 --no-plots`, {programs:,} small programs"
    row = (name, f"{statistics.median(seconds):.1f}", f"{ratio:.2f}", bar(clears, f"at most {BAR:g}"))
    return table("command | CPU seconds of the analyses and their reports, median: | times these: | bar", [row]), clears


def measure_pictures(programs: int = WITH_PICTURES) -> tuple[list[str], bool]:
    """What two pictures and a page cost a program: lines of the table, and whether the bar is cleared."""
    command = [sys.executable, "-m", "toolpath_stiff", "analyze", "programs", "--jobs", "1"]
    seconds = []
    for words in (["--no-plots"], []):
        with tempfile.TemporaryDirectory() as folder:
            write_programs(Path(folder) / "programs", programs)
            seconds.append(whole_process([*command, *words], folder)[0] / programs)
    without, drawn = seconds[0], seconds[1] - seconds[0]
    clears = drawn <= PICTURES_BAR
    name = f"`tps analyze FOLDER --jobs 1`, {programs:,} small programs"
    row = (name, f"{without:.3f}", f"{drawn:.3f}", bar(clears, f"at most {PICTURES_BAR:g}"))
    return table("command | CPU seconds a program without pictures: | two pictures and a page: | bar", [row]), clears


def main() -> int:
    """`python -m benchmarks.many [PROGRAMS [ROUNDS]]`."""
    programs, rounds = (int(word) for word in [*sys.argv[1:], *("2000", "1")[len(sys.argv) - 1 :]])
    lines, passed = measure_many(rounds, programs)
    print("\n".join(lines))
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
