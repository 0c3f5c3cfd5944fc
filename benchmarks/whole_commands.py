"""CPU time of whole commands as a user gives them, and of many small programs in one command."""

import shutil
import statistics
import sys
import tempfile
from pathlib import Path

from benchmarks.diagnosis_cases import campaign
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
    (("diagnose", "readings.csv"), f"`tps diagnose`, {READINGS} readings, all files", 3.0),
    (("update", "readings.csv", "--add", "weak_strut"), f"`tps update`, {READINGS} readings, all files", 2.0),
)
MANY_BAR = 1.2  # times the CPU of the analyses
PICTURES_BAR = 0.15  # s of CPU a program for two pictures and a page
THEMSELVES = """
import sys
from pathlib import Path
import toolpath_stiff as tps
machine = tps.Machine.load("nist")
for file in sorted(Path("programs").iterdir()):
    tps.analyze(tps.Program.read(file), machine).save(Path("alone", file.stem), plots=False)
"""


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


def write_programs(folder: Path, count: int) -> None:
    """Small plain programs, no two alike: a frame in two depths, about 400 mm of cuts."""
    folder.mkdir()
    for i in range(count):
        x, y = 40 + i % 30, 40 + i % 23
        frame = f"X{x}\nY{y}\nX0\nY0\n"
        text = f"G21 G90 F1000\nG0 X0 Y0 Z5\nG1 Z-1\n{frame}G1 Z-2\n{frame}G0 Z50\nM2\n"
        (folder / f"part{i:04}.nc").write_text(text)


def measure_many(rounds: int, programs: int) -> tuple[list[str], bool]:
    """Lines of the table, and whether the bar is cleared."""
    alone = [sys.executable, "-c", THEMSELVES]
    command = [sys.executable, "-m", "toolpath_stiff", "analyze", "programs", "--jobs", "1", "--no-plots"]
    ratios, seconds = [], []
    for _ in range(rounds):
        with tempfile.TemporaryDirectory() as folder:
            write_programs(Path(folder) / "programs", programs)
            seconds.append(whole_process(alone, folder)[0])
            ratios.append(whole_process(command, folder)[0] / seconds[-1])
    ratio, clears = statistics.median(ratios), statistics.median(ratios) <= MANY_BAR
    name = f"`tps analyze FOLDER --jobs 1 --no-plots`, {programs:,} small programs"
    row = (name, f"{statistics.median(seconds):.1f}", f"{ratio:.2f}", bar(clears, f"at most {MANY_BAR:g}"))
    return table("command | CPU seconds of the analyses and their reports, median: | times these: | bar", [row]), clears


def measure_pictures(programs: int) -> tuple[list[str], bool]:
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
