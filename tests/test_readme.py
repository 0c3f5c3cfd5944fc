"""What the README shows is what the commands print.

With TPS=.../bin/tps in the environment it is the installed tool that is run (`make dist`), else the checkout.
"""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from toolpath_stiff.cli.main import main

ROOT = Path(__file__).parent.parent
TPS = os.environ.get("TPS")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def shown(command: str) -> list[str]:
    """Lines that the README shows below a command, up to an ellipsis."""
    block = README.split(f"$ {command}\n", 1)[1].split("```", 1)[0].split("\n$ ", 1)[0]
    if block.startswith("$ "):
        return []
    return block.split("\n...", 1)[0].rstrip().splitlines()


NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
COMMANDS = [line[2:] for line in README.splitlines() if line.startswith("$ tps ")]


def test_commands_print_what_is_shown(tmp_path, monkeypatch, capsys):
    """In the order of the README, in one test: one command may need what an earlier one wrote."""
    (tmp_path / "programs").symlink_to(ROOT / "programs")
    monkeypatch.chdir(tmp_path)
    assert len(COMMANDS) > 8
    for command in COMMANDS:
        arguments = command.split("#")[0].split()[1:]
        if arguments[0] in ("analyze", "place", "diagnose", "update"):
            arguments.append("--no-plots")
        assert_alike(printed(arguments, capsys).splitlines()[: len(shown(command))], shown(command))


def printed(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    """What a command prints; it must succeed."""
    if TPS:
        return installed(TPS, *arguments)
    assert main(arguments) == 0, arguments
    return capsys.readouterr().out


def installed(*command: str) -> str:
    """What a command of another environment prints, with nothing of this one on its path."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


def assert_alike(printed: list[str], expected: list[str]) -> None:
    """The same words, and numbers that differ in their last digits at most."""
    assert [NUMBER.sub("#", line) for line in printed] == [NUMBER.sub("#", line) for line in expected]
    for line, other in zip(printed, expected, strict=True):
        # Last digits depend on the processor's arithmetic, a search's way on all digits: three turns are alike.
        if not line.startswith(("recommended", "LinuxCNC")):
            numbers = [float(number) for number in NUMBER.findall(other)]
            assert [float(number) for number in NUMBER.findall(line)] == pytest.approx(numbers, rel=5e-3), line


def test_python_example_runs(tmp_path, monkeypatch, capsys):
    (tmp_path / "programs").symlink_to(ROOT / "programs")
    monkeypatch.chdir(tmp_path)
    code = README.split("```python\n", 1)[1].split("```", 1)[0]
    if TPS:
        out = installed(str(Path(TPS).with_name("python")), "-c", code)
    else:
        exec(compile(code, "README.md", "exec"), {})
        out = capsys.readouterr().out
    assert "stiffness_N_per_mm" in out


def test_the_first_screen_says_what_it_is_and_what_to_do():
    screen = README.splitlines()[:12]
    assert sum(line.startswith("![") for line in screen) == 1
    assert [line.split()[:2] for line in screen if line.startswith("    ")] == [["make", "demo"], ["make", "test"]]
    assert [line.split()[2] for line in screen if line.startswith("- `tps ")] == ["analyze", "place", "diagnose"]
    between = README.split("**1. ", 1)[1].split("**2. ", 1)[0].split("```")[-1]
    assert len(between.strip().splitlines()) <= 3


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert target.startswith("http") or (ROOT / target).exists(), target
