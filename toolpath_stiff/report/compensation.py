"""A compensated program in words."""

from toolpath_stiff.cutting.compensation import Compensation
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import counted, figure

MOST_LINES = 12
COLUMNS = {
    "line": "line", "side": "side", ">shift um": "shift_um", ">before": "size_before_um", ">after": "size_after_um",
    ">peak before": "peak_before_um", ">after ": "peak_after_um", ">range um": "spread_um",
}  # fmt: skip


def text(compensation: Compensation) -> str:
    """Walls together, the lines that were worst, the lines left alone, notes; for the terminal."""
    walls, frame = compensation.walls, compensation.lines
    rows = range(len(frame["line"]))
    worst = sorted(rows, key=lambda row: -frame["peak_before_um"][row])[:MOST_LINES]
    cells = [[figure(frame[name][row]) for name in COLUMNS.values()] for row in worst]
    alone = {(frame["line"][row], frame["left_alone"][row]): None for row in rows if frame["left_alone"][row]}
    return "\n".join(
        [
            f"{compensation.rewritten.name}: walls of {walls['length_mm']:.0f} mm, error as the mean over their height",
            f"  mean size     {walls['mean_before_um']:.2f} um, compensated {walls['mean_after_um']:.2f} um"
            f" ({walls['left_percent']:.0f} % left)",
            f"  worst place   {walls['worst_before_um']:.2f} um, compensated {walls['worst_after_um']:.2f} um",
            f"  over height   {walls['mean_range_um']:.2f} um in the mean, which no shift removes",
            f"  {counted(compensation.turns, 'turn')} of the iteration; courses within"
            f" {max(compensation.course_error_um, 0.01):.2f} um of their shift",
            "",
            *ShownTable([*COLUMNS], cells).lines(least=4),
            *([f"  ... and {len(rows) - len(worst)} more"] if len(rows) > len(worst) else []),
            *(f"left alone: line {line}: {reason}" for line, reason in alone),
            *(f"note: {note}" for note in compensation.notes),
        ]
    )


DATA = {"compensation.json": Compensation.to_json}
