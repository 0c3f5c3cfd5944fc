"""`tps case-study`: the paper's four regions."""

from __future__ import annotations

import argparse
import json
import sys

from toolpath_stiff.cli.arguments import add_json_option, add_machine_options, model_for
from toolpath_stiff.cli.outputs import add_replace_option, destination
from toolpath_stiff.files import Content

EPILOG = """\
Writes case_study.csv, case_study.json, case_study.md, regions.png and heights.png: one tool path at two heights,
displaced and turned, as the paper's Figure 10; its three conclusions checked one by one; where they stop holding.
"""

DATA, PICTURES = ("case_study.csv", "case_study.json", "case_study.md"), ("regions.png", "heights.png")


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
    from toolpath_stiff.placement.case_study import region_rows, run_case_study, study_text

    target = destination(args, "case-study", [args.machine], "-case-study").check(
        DATA if args.no_plots else (*DATA, *PICTURES)
    )
    study = run_case_study(model_for(args))
    text = json.dumps(study.summary, indent=2) + "\n"
    contents: dict[str, Content] = dict(zip(DATA, (region_rows(study), text, study_text(study)), strict=True))
    if not args.no_plots:
        from toolpath_stiff.report.case_study_picture import heights_picture, regions_picture

        contents |= zip(PICTURES, (regions_picture(study), heights_picture(study)), strict=True)
    files = target.write(contents)
    if args.json:
        sys.stdout.write(text)
        return 0
    print(study_text(study))
    print("\n".join(["written:", *(f"  {file}" for file in files)]))
    return 0
