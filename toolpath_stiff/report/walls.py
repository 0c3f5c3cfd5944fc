"""Text and tables on measured walls against predicted errors."""

from toolpath_stiff.column_files import csv_text
from toolpath_stiff.comparison.walls import WallComparison
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import figure

COLUMNS = {
    "line": "line", "side": "side", ">points": "points", ">measured um": "measured_um", ">predicted": "predicted_um",
    ">residual": "residual_um", ">sure beyond": "sure_um", "verdict": "fails",
}  # fmt: skip
VERDICT = {True: "the model fails", False: "as predicted"}


def text(comparison: WallComparison) -> str:
    """Text for the terminal on measured and predicted errors, each line with its verdict, and notes."""
    document, (factor, spread) = comparison.to_dict(), comparison.factor
    rows = sorted(document["lines"], key=lambda row: -abs(row["residual_um"]))
    rows = [{**row, "fails": VERDICT[row["fails"]]} for row in rows]
    cells = [[figure(row[name]) for name in COLUMNS.values()] for row in rows]
    others = f"; {comparison.others} lie on no final wall" if comparison.others else ""
    return "\n".join(
        [
            f"{document['points']} points on final walls{others}",
            f"  measured    {document['mean_measured_um']:.2f} um in the mean of sizes",
            f"  residual    {document['mean_residual_um']:.2f} um, measured less predicted at the height of each point",
            f"  factor      {factor:.2f} +- {2.0 * spread:.2f}, measured over predicted",
            "",
            *ShownTable([*COLUMNS], cells).lines(least=4),
            *(f"note: {note}" for note in comparison.notes),
        ]
    )


def _residuals(comparison: WallComparison) -> str:
    frame = comparison.to_frame()
    return csv_text([*frame.columns], ([figure(value) for value in row] for row in frame.itertuples(index=False)))


DATA = {"compare.json": WallComparison.to_json, "residuals.csv": _residuals}
