"""What commands cost over the size of their input: CPU and memory of whole processes, as a table and a picture."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from benchmarks import pages
from benchmarks.diagnosis_size import campaign
from benchmarks.processes import whole_command
from benchmarks.size_programs import program

LINES = (1_000, 10_000, 100_000)
MORE_LINES = (*LINES, 1_000_000)
READINGS = (144, 288, 576, 1_000)
MORE_READINGS = (*READINGS, 5_000)


@dataclass(frozen=True)
class Cost:
    """One command on one input: how large it is, CPU s, peak memory MB."""

    command: str
    unit: str
    size: int
    seconds: float
    megabytes: float


def commands(full: bool) -> Iterator[tuple[str, str, tuple[int, ...], Callable[[int], str], str, tuple[str, ...]]]:
    """What is measured: label, unit, sizes, content of the input by size, its name, words after it."""
    lines, readings = (MORE_LINES, MORE_READINGS) if full else (LINES, READINGS)
    at = ("--origin", "0,0,800")

    def text(size: int) -> str:
        return program("3-axis", size)

    yield "check", "lines", lines, text, "part.nc", ("check", *at)
    yield "analyze --no-plots", "lines", lines, text, "part.nc", ("analyze", *at, "--no-plots", "--out", "out")
    for name in ("compare", "diagnose"):
        yield f"{name} --no-plots", "readings", readings, campaign, "data.csv", (name, "--no-plots", "--out", "out")


def measure_growth(full: bool) -> list[Cost]:
    """All costs, sizes of one command rising."""
    found = []
    for label, unit, sizes, content, name, words in commands(full):
        for size in sizes:
            with tempfile.TemporaryDirectory() as folder:
                (Path(folder) / name).write_text(content(size), encoding="utf-8")
                found.append(Cost(f"tps {label}", unit, size, *whole_command([words[0], name, *words[1:]], folder)))
    return found


def table(costs: list[Cost]) -> list[str]:
    """Lines of the table."""
    rows = [
        (f"`{cost.command}`", f"{cost.size:,} {cost.unit}", f"{cost.seconds:.2f}", f"{cost.megabytes:.0f}")
        for cost in costs
    ]
    return pages.table("command | size: | CPU, s: | peak memory, MB:", rows)


def picture(costs: list[Cost], file: Path) -> None:
    """CPU above, memory below, over the size; programs on the left, measurements on the right."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 2, sharex="col", sharey="row")
    for column, unit in enumerate(("lines", "readings")):
        for command in dict.fromkeys(one.command for one in costs if one.unit == unit):
            mine = [one for one in costs if one.command == command]
            sizes = [one.size for one in mine]
            axes[0, column].loglog(sizes, [one.seconds for one in mine], "o-", label=command)
            axes[1, column].loglog(sizes, [one.megabytes for one in mine], "o-", label=command)
        axes[1, column].set_xlabel(f"{unit} of the input")
        axes[0, column].legend()
    axes[0, 0].set_ylabel("CPU, s")
    axes[1, 0].set_ylabel("peak memory, MB")
    for one in axes.flat:
        one.grid(visible=True, which="major", alpha=0.4)
    figure.savefig(file, dpi=120)
