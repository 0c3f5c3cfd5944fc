"""`tps case-study`: the paper's four regions."""

from __future__ import annotations

import argparse
import sys

from toolpath_stiff.cli.arguments import add_json_option, add_machine_options, model_for
from toolpath_stiff.cli.outputs import add_replace_option, destination

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
    """Analyse the regions and write the files."""
    from toolpath_stiff.placement.case_study import run_case_study, study_text
    from toolpath_stiff.report.case_study import files, names

    target = destination(args, "case-study", [args.machine], "-case-study").check(names(not args.no_plots))
    study = run_case_study(model_for(args))
    contents = files(study, plots=not args.no_plots)
    written = target.write(contents)
    if args.json:
        sys.stdout.write(str(contents["case_study.json"]))
        return 0
    print(study_text(study))
    print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0
