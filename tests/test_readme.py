"""What the README shows is what the commands print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from toolpath_stiff.cli.main import main

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def shown(command: str) -> list[str]:
    """Lines that the README shows below a command, up to an ellipsis."""
    block = README.split(f"$ {command}\n", 1)[1].split("```", 1)[0]
    return block.split("...", 1)[0].rstrip().splitlines()


@pytest.mark.parametrize("command", ["tps analyze programs/pocket.nc", "tps pose -300 300 300 -30 0 0"])
def test_output_of_commands(command, tmp_path, monkeypatch, capsys):
    arguments = command.split()[1:]
    if arguments[0] == "analyze":
        arguments[1] = str(ROOT / arguments[1])
        arguments.append("--no-plots")
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 0
    assert capsys.readouterr().out.splitlines()[: len(shown(command))] == shown(command)


def test_figure_of_the_third_example(tmp_path, monkeypatch, capsys):
    line = next(line for line in README.splitlines() if line.startswith("$ tps analyze") and "--origin" in line)
    arguments = line.split("|")[0].split()[2:]
    arguments[1] = str(ROOT / arguments[1])
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 0
    pattern = r'"mean_N_per_mm": ([\d.]+),'
    printed = re.search(pattern, capsys.readouterr().out)
    # The last digits depend on the processor's arithmetic.
    assert float(printed[1]) == pytest.approx(float(re.search(pattern, README)[1]), rel=1e-12)


def test_python_example_runs(monkeypatch, capsys):
    monkeypatch.chdir(ROOT)
    code = README.split("```python\n", 1)[1].split("```", 1)[0]
    exec(compile(code, "README.md", "exec"), {})
    assert "stiffness_N_per_mm" in capsys.readouterr().out


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert target.startswith("http") or (ROOT / target).exists(), target
