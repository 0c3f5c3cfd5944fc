"""CPU time of whole commands: what a user waits for before anything is computed."""

from __future__ import annotations

import statistics
import tempfile
from pathlib import Path

from benchmarks.processes import whole_command

HELP_BAR, ANALYZE_BAR = 0.15, 0.60  # s of CPU


def program_of_500_poses() -> str:
    """A plain program that samples to about 500 poses at 1 mm."""
    rows = "".join(f"X{48 * (i % 2)} Y{i}\n" for i in range(10))
    return f"G21 G90 F1000\nG0 X0 Y0 Z0\nG1 Z-1\n{rows}M2\n"


def measure_startup(rounds: int) -> tuple[list[str], bool]:
    """Lines of the table, and whether both bars are cleared."""
    lines = ["| command | CPU seconds, median | bar |", "| --- | ---: | --- |"]
    passed = True
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "part.nc").write_text(program_of_500_poses())
        for label, command, bar in (
            ("`tps --help`", ["--help"], HELP_BAR),
            ("`tps analyze part.nc --no-plots`, 500 poses", ["analyze", "part.nc", "--no-plots"], ANALYZE_BAR),
        ):
            whole_command(command, folder)
            median = statistics.median(whole_command(command, folder)[0] for _ in range(rounds))
            clears = median < bar
            passed &= clears
            lines.append(f"| {label} | {median:.3f} | under {bar:g}{'' if clears else ': NOT CLEARED'} |")
    return lines, passed
