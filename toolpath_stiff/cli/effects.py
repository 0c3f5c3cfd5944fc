"""`tps effects`: the physical effects that a machine can carry, along the load path; a start for one's own."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from toolpath_stiff.cli.arguments import add_json_option
from toolpath_stiff.cli.outputs import add_replace_option, check_new, keep
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import command_line, hint, options

CHECK_FAILED = 1
EPILOG = """\
examples:
  tps effects list
  tps effects show platform_flexibility
  tps effects new my_screw.py            a working effect to change into yours
  tps effects check my_screw.py          shapes, symmetry, units, neutral value, speed; exit code 1 if it fails
  tps effects list --effects my_screw.py

Machine files carry effects as [[effect]], those that act on readings as [[instrument]].
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    actions = parser.add_subparsers(dest="action", metavar="list|show|new|check", required=True)
    listing = actions.add_parser("list", help="all effects, in the order of the load path")
    showing = actions.add_parser("show", help="equation, parameters, units, bounds, typical values and their source")
    showing.add_argument("name", metavar="NAME", help="name of the effect")
    for sub in (listing, showing):
        sub.add_argument(
            "--effects", action="append", default=[], metavar="FILE.py", help="file with your own physical effects"
        )
        add_json_option(sub, "print JSON")
    checking = actions.add_parser("check", help="try the effects of a file against the contract")
    checking.add_argument("file", metavar="FILE.py", help="file with your own physical effects")
    checking.add_argument("--machine", default="nist", metavar="NAME|FILE", help="to try them on (default: nist)")
    add_json_option(checking, "print JSON")
    writing = actions.add_parser("new", help="write a commented, working example of an effect")
    writing.add_argument("file", metavar="FILE.py", help="file to write")
    add_replace_option(writing)


def run(args: argparse.Namespace) -> int:
    """List, show, check or write."""
    return {"list": _list, "show": _show, "check": _check, "new": _new}[args.action](args)


def _list(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.effects import effects

    found = effects(args.effects)
    sys.stdout.write(found.to_json() if args.json else f"{found}\n")
    return 0


def _show(args: argparse.Namespace) -> int:
    from toolpath_stiff.api.results import json_text
    from toolpath_stiff.report.effects import describe, details
    from toolpath_stiff.stiffness.effects import find_effect

    effect = find_effect(args.name, args.effects)
    sys.stdout.write(json_text(describe(effect)) if args.json else f"{details(effect)}\n")
    return 0


def _check(args: argparse.Namespace) -> int:
    """Try every effect of a file; exit code 1 if one fails."""
    from toolpath_stiff.api.effects import check_effects

    found = check_effects(args.file, args.machine)
    sys.stdout.write(found.to_json() if args.json else f"{found}\n")
    return 0 if found.passed else CHECK_FAILED


def _new(args: argparse.Namespace) -> int:
    """Write the example effect, named after its file."""
    from toolpath_stiff.api.effects import effect_template

    target = Path(args.file)
    if target.suffix != ".py" or not target.stem.isidentifier():
        raise InputError(f"{args.file!r} cannot hold an effect", expected="a name such as my_screw.py")
    keep(check_new(args, args.file))
    effect_template(target.stem).save(target)
    line = command_line("effects", "show", target.stem, *options(effects=args.file))
    print(f"wrote {args.file}\n{hint('read it back', line)}")
    return 0
