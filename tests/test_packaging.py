"""Wheel and sdist: complete, one version, and the tool runs from what they hold. `make dist` installs them."""

from __future__ import annotations

import email
import json
import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

import toolpath_stiff

pytest.importorskip("build")
ROOT = Path(__file__).parent.parent
PACKAGE = ROOT / "toolpath_stiff"


@pytest.fixture(scope="module")
def built(tmp_path_factory) -> Path:
    """The folder with sdist and wheel; the wheel is made from the sdist, which must therefore be complete."""
    out = tmp_path_factory.mktemp("dist")
    words = [sys.executable, "-m", "build", "--no-isolation", "--outdir", out, ROOT]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return out


@pytest.fixture(scope="module")
def unpacked(built, tmp_path_factory) -> Path:
    """What the wheel installs."""
    out = tmp_path_factory.mktemp("wheel")
    with zipfile.ZipFile(next(built.glob("*.whl"))) as wheel:
        wheel.extractall(out)
    return out


def run(unpacked: Path, cwd: Path, *words: str) -> str:
    """Python away from the checkout, with the tool as the wheel holds it."""
    environment = {**os.environ, "PYTHONPATH": str(unpacked)}
    command = [sys.executable, *words]
    return subprocess.run(command, cwd=cwd, env=environment, capture_output=True, text=True, check=True).stdout


# Commands, as JSON, in one process; a form feed after what each prints.
ONE_BY_ONE = """
import json, sys
from toolpath_stiff.cli.main import main
for words in json.loads(sys.argv[1]):
    assert main(words) == 0, words
    print(end="\\f")
"""


def files(folder: Path) -> set[str]:
    """What a package must hold: all but compiled files."""
    found = (path for path in folder.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(folder).as_posix() for path in found}


def test_wheel_holds_every_file_of_the_package(unpacked):
    assert files(unpacked / "toolpath_stiff") == files(PACKAGE)


def test_wheel_holds_nothing_beside_the_package(unpacked):
    assert {path.name.split("-")[0] for path in unpacked.iterdir()} == {"toolpath_stiff"}


def test_there_is_one_version(built, unpacked):
    metadata = email.message_from_string(next(unpacked.glob("*.dist-info/METADATA")).read_text("utf-8"))
    assert metadata["Version"] == toolpath_stiff.__version__
    assert metadata["License-Expression"] == "GPL-3.0-or-later"
    assert "version" not in tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert {path.name.split("-")[1].removesuffix(".tar.gz") for path in built.iterdir()} == {toolpath_stiff.__version__}


def test_wheel_has_the_command(unpacked):
    text = next(unpacked.glob("*.dist-info/entry_points.txt")).read_text("utf-8")
    assert "tps = toolpath_stiff.cli.main:entry" in text


def test_sdist_holds_what_the_readme_shows(built):
    with tarfile.open(next(built.glob("*.tar.gz"))) as sdist:
        names = {name.split("/", 1)[-1] for name in sdist.getnames()}
    assert {
        "README.md",
        "LICENSE",
        "CHANGELOG.md",
        "programs/pocket.nc",
        "docs/conf.py",
        "docs/images/report.png",
    } <= names
    assert not any(
        name.startswith(("docs/_build", "docs/api/", "docs/commands/", ".venv")) or "__pycache__" in name
        for name in names
    )


def test_the_tool_runs_from_the_wheel(unpacked, tmp_path):
    """Pages, templates, machines and readings are files of the package: each is read once."""
    assert toolpath_stiff.__version__ in run(unpacked, tmp_path, "-m", "toolpath_stiff", "--version")
    commands = [
        ["analyze", str(ROOT / "programs" / "pocket.nc"), "--step", "5"],
        ["machine", "new", "mine.toml"],
        ["machine", "show", "mine.toml"],
        ["effects", "new", "my_screw.py"],
        ["compare", "nist-table1", "--no-plots"],
    ]
    said = run(unpacked, tmp_path, "-c", ONE_BY_ONE, json.dumps(commands)).split("\f")
    assert "pocket.nc" in said[0] and "mine" in said[2] and "42 readings" in said[4]
    assert "<script" in (tmp_path / "reports" / "pocket" / "report.html").read_text("utf-8")
