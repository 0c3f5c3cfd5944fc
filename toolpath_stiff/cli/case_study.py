"""`tps case-study`: the paper's four regions."""

from __future__ import annotations

import argparse

from toolpath_stiff.cli.arguments import add_json_option, add_machine_options, machine_for
from toolpath_stiff.cli.outputs import add_replace_option, destination, show

EPILOG = """\
Writes case_study.csv, case_study.json, case_study.md, regions.png and heights.png: one tool path at two heights,
displaced and turned, as the paper's Figure 10; its three conclusions checked one by one; where they stop holding.
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("--out", metavar="DIR", help="folder (default: reports/<machine>-case-study)")
    add_replace_option(parser, force=False)
    parser.add_argument("--no-plots", action="store_true", help="no pictures")
    add_machine_options(parser)
    add_json_option(parser, "print case_study.json to standard output and nothing else")


def run(args: argparse.Namespace) -> int:
    """Analyze the regions and write the files."""
    from toolpath_stiff.api.placements import case_study
    from toolpath_stiff.report.case_study import names

    target = destination(args, "case-study", [args.machine], "-case-study").check(names(not args.no_plots))
    return show(args, case_study(machine_for(args)), target)
