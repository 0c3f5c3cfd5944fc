"""Siemens' language: small programs whose paths are known from geometry; refusals; the table of words.

Paths (`siemens_paths.txt`) are written as those of `test_heidenhain`.
"""

import re
from pathlib import Path

import pytest

from tests.nc.test_heidenhain import check_path
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import ToolEntry

TOOLS = Controller(
    DIALECTS["siemens"],
    tools={1: ToolEntry(1, diameter=10.0, remark="MILL 10"), 2: ToolEntry(2, length=50.0, diameter=4.0)},
)
PATHS = {  # name -> program, path
    name: (body, path)
    for name, body, path in re.findall(
        r"^== (.*)\n((?:.*\n)*?)=> ((?:.*\n?)*?)(?=\n== |\Z)",
        (Path(__file__).parent / "siemens_paths.txt").read_text(),
        re.MULTILINE,
    )
}


def read(body: str, controller: Controller = TOOLS):
    return parse_program(body, "t.mpf", controller=controller)


@pytest.mark.parametrize("name", PATHS)
def test_paths_known_from_geometry(name):
    program = read(PATHS[name][0])
    check_path(program, PATHS[name][1])
