"""The committed reports on the paper's readings are what the commands in reports/README.md write."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from toolpath_stiff.cli.main import main

ROOT = Path(__file__).parent.parent
COMMANDS = re.findall(r"^tps (\w+ nist-table1.*?) --out (\S+)$", (ROOT / "reports/README.md").read_text(), re.M)
# Last digits depend on the processor's arithmetic, and with them now and then one of 400 simulated campaigns.
CLOSE = 0.02


def flattened(document, path=""):
    """Every number and word of a document by its place; sentences repeat numbers and are left out.

    So is what differs from run to run: where a file was written to, and by which command.
    """
    if isinstance(document, dict):
        for key, value in document.items():
            if key in ("machine_file", "command"):
                continue
            yield from flattened(value, f"{path}/{key}")
    elif isinstance(document, list):
        for place, value in enumerate(document):
            yield from flattened(value, f"{path}/{place}")
    elif not isinstance(document, str) or " " not in document:
        yield path, document


@pytest.mark.parametrize(("command", "folder"), COMMANDS, ids=[Path(folder).name for _, folder in COMMANDS])
def test_committed_reports_are_what_the_commands_write(command, folder, tmp_path, capsys):
    name = command.split()[0]
    assert main([*command.split(), "--no-plots", "--out", str(tmp_path)]) == 0
    capsys.readouterr()
    ours = dict(flattened(json.loads((tmp_path / f"{name}.json").read_text())))
    committed = dict(flattened(json.loads((ROOT / folder / f"{name}.json").read_text())))
    assert list(ours) == list(committed)
    for key, value in committed.items():
        near = pytest.approx(value, rel=CLOSE, abs=CLOSE) if isinstance(value, float) else value
        assert ours[key] == near, key
    assert (tmp_path / "residuals.csv").read_text().count("\n") == 43


def test_the_paper_s_readings_give_no_confident_name():
    """The negative control of the whole method."""
    document = json.loads((ROOT / "reports/nist_table1/diagnose/diagnose.json").read_text())
    assert set(document["by_noise"]) == {"low", "high"} and document["verdict"] != "identified"
    assert len(document["plausible"]) > 1
    assert "none" in document["plausible"]
    assert not json.loads((ROOT / "reports/nist_table1/update/update.json").read_text())["support"]
