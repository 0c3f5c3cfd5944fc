"""CPU time of whole commands: what a user waits for before anything is computed."""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

HELP_BAR, ANALYZE_BAR = 0.15, 0.60  # s of CPU


def cpu_seconds(command: list[str], folder: str) -> float:
    """User and system time of a child process."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def program_of_500_poses() -> str:
    """A plain program that samples to about 500 poses at 1 mm."""
    rows = "".join(f"X{48 * (i % 2)} Y{i}\n" for i in range(10))
    return f"G21 G90 F1000\nG0 X0 Y0 Z0\nG1 Z-1\n{rows}M2\n"


def measure_startup(rounds: int) -> tuple[list[str], bool]:
    """Lines of the table, and whether both bars are cleared."""
    lines = ["| command | CPU seconds, median | bar |", "| --- | ---: | --- |"]
    passed = True
    tps = [sys.executable, "-m", "toolpath_stiff"]
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "part.nc").write_text(program_of_500_poses())
        for label, command, bar in (
            ("`tps --help`", [*tps, "--help"], HELP_BAR),
            ("`tps analyze part.nc --no-plots`, 500 poses", [*tps, "analyze", "part.nc", "--no-plots"], ANALYZE_BAR),
        ):
            cpu_seconds(command, folder)
            median = statistics.median(cpu_seconds(command, folder) for _ in range(rounds))
            clears = median < bar
            passed &= clears
            lines.append(f"| {label} | {median:.3f} | under {bar:g}{'' if clears else ': NOT CLEARED'} |")
    return lines, passed
