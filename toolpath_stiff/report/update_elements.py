"""Text of an update of a machine of elements, and its files."""

from toolpath_stiff.correction.on_elements import ElementUpdate
from toolpath_stiff.report.diagnose_elements import residuals_csv
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.update import support_table


def text(update: ElementUpdate) -> str:
    """Text on what was done, the errors of each step, and the evidence for and against it."""
    names = ("mean_abs_error_percent", "held_out_error_percent", "rms_error_percent",
             "rms_error_at_left_out_poses_percent")  # fmt: skip
    rows = [(step["name"], *(f"{step[name]:.2f} %" for name in names)) for step in update.document["steps"]]
    steps = ShownTable(("", ">mean error", ">left out", ">rms", ">rms at left-out poses"), rows)
    against = support_table(update)
    return "\n".join([update.text, "", *steps.lines(), *(["", *against.lines()] if against.rows else [])])


DATA = {
    "update.json": ElementUpdate.to_json,
    "residuals.csv": residuals_csv,
    "machine.toml": ElementUpdate.machine_text,
}
