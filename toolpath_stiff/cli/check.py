"""`tps check`: what a program uses, what is not understood, extents, times, and what a machine says to it."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import add_json_option, add_program_options, controller_for, positive_number
from toolpath_stiff.errors import InputError
from toolpath_stiff.units import m_per_s_from_mm_per_min

if TYPE_CHECKING:
    from toolpath_stiff.nc.checking import Checked, Finding

EPILOG = """\
examples:
  tps check part.nc
  tps check part.nc --dialect fanuc --json
  tps check part.nc --strut-speed 5000         warn of cuts in which a strut is faster, mm/min
  tps check part.nc --machine none             the program alone, no reach and no strut speeds
  tps check part.ngc --interpreter auto        by LinuxCNC's interpreter where ours does not read it to its end

Where the reader would refuse the program, the check says so and goes on with the next block; what it says of extents,
lengths and times is then that of the blocks that could be read. Extents are those of the tool tip in program
coordinates of G54, mm and degrees. Exit code 1 if there is any error.
"""
NO_MACHINE = "none"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("program", metavar="PROGRAM", help="NC program or cutter-location file")
    add_program_options(parser)
    parser.add_argument(
        "--machine",
        default="nist",
        metavar="NAME|FILE",
        help="machine whose reach and strut speeds are checked; none: no machine (default: nist)",
    )
    parser.add_argument(
        "--strut-speed", type=positive_number("mm/min", 1e6), metavar="MM/MIN", help="largest speed of a strut"
    )
    add_json_option(
        parser,
        "print JSON: used, unsupported, findings, extents_mm, lengths_mm, times_s, tools, operations, modal state",
    )


def run(args: argparse.Namespace) -> int:
    """Check and print."""
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.nc.checking import ERROR, check_by
    from toolpath_stiff.nc.words import read_lines

    machine = None if args.machine == NO_MACHINE else load_machine(args.machine)
    if machine is None and args.strut_speed is not None:
        raise InputError("--strut-speed without a machine", hint="name one with --machine")
    controller = controller_for(args)
    name = Path(args.program).name
    lines = read_lines(args.program)
    checked, interpreter = check_by(
        args.interpreter,
        lines,
        name,
        origin=args.origin,
        default_origin=machine.default_origin if machine else (0.0,) * 6,
        block_delete=args.block_delete,
        controller=controller,
        rs274=args.rs274,
    )
    document = {
        "program": name,
        "interpreter": interpreter,
        "dialect": checked.dialect or controller.label,
        "kinematics": controller.kinematics.label
        if controller.kinematics and checked.dialect in ("", "linuxcnc")
        else "",
        **_document(args, checked, lines, machine),
    }
    if args.json:
        json.dump(document, sys.stdout, indent=2, ensure_ascii=False, allow_nan=False)
        sys.stdout.write("\n")
    else:
        from toolpath_stiff.report.check import text

        sys.stdout.write(text(document))
    return 1 if any(finding["severity"] == ERROR for finding in document["findings"]) else 0


def _document(args: argparse.Namespace, checked: Checked, lines: tuple[str, ...], machine: Any) -> dict[str, Any]:
    """What `--json` prints."""
    from toolpath_stiff.analysis.checks import (
        Figures,
        check_parts,
        figure_rows,
        figures,
        machine_findings,
        radii_findings,
    )

    findings: list[Finding] = list(checked.findings)
    found = Figures({}, {}, {}, {})
    speed: dict[str, float] = {}
    rapid_feed = [machine.rapid_feed] if machine else []
    tools, operations = check_parts(checked, lines, Path(args.program).name, *rapid_feed)
    if checked.moves is not None:
        found = figures(checked.moves, *rapid_feed)
        findings += radii_findings(checked.moves)
        if machine is not None:
            limit = None if args.strut_speed is None else m_per_s_from_mm_per_min(args.strut_speed)
            more, speed = machine_findings(checked, machine, checked.origin, args.step, limit)
            findings += more
    findings.sort(key=lambda finding: (finding.line, finding.column))
    return {
        "complete": checked.complete,
        "used": [asdict(code) for code in checked.used],
        "unsupported": [asdict(word) for word in checked.unsupported],
        "findings": [asdict(finding) for finding in findings],
        **figure_rows(found),
        "tools": tools,
        "operations": operations,
        "fastest_strut": speed,
        "modal_start": checked.start,
        "modal_end": checked.end,
    }
