"""The command on physical effects."""

from __future__ import annotations

import sys
from argparse import Namespace

from toolpath_stiff.api import effects
from toolpath_stiff.api.diagnosis import Measurements
from toolpath_stiff.api.machines import Machine
from toolpath_stiff.cli.measurements import measured
from toolpath_stiff.cli.outputs import check_new, check_written, keep
from toolpath_stiff.cli.parser import DATA, JSON, REPLACE, Command, given, own
from toolpath_stiff.cli.progress import progress_line
from toolpath_stiff.hints import command_line, hint, options
from toolpath_stiff.options import arguments_of

CHECK_FAILED = 1
EXAMPLES = """\
examples:
  tps effects list
  tps effects show platform_flexibility
  tps effects new my_screw.py            a working effect to change into yours
  tps effects draft measurements.csv -o missing.toml  what a diagnosis leaves unexplained, as an effect to edit
  tps effects check my_screw.py          shapes, symmetry, units, neutral value, speed; exit code 1 if it fails
  tps effects list --effects my_screw.py

Machine files carry effects as [[effect]], those that act on readings as [[instrument]].
"""


def list_effects(args: Namespace) -> int:
    """All effects, in the order of the load path."""
    catalogue = effects.effects(args.effects)
    sys.stdout.write(catalogue.to_json() if args.json else f"{catalogue}\n")
    return 0


def show_effect(args: Namespace) -> int:
    """Equation, parameters, units, bounds, typical values and their source."""
    from toolpath_stiff.report.effects import describe_effect, effect_details
    from toolpath_stiff.results import json_text
    from toolpath_stiff.stiffness.catalogue import find_effect

    effect = find_effect(args.name, args.effects)
    sys.stdout.write(json_text(describe_effect(effect)) if args.json else f"{effect_details(effect)}\n")
    return 0


def check_effects(args: Namespace) -> int:
    """Try the effects of a file against the contract; exit code 1 if one fails."""
    check = effects.check_effects(args.file, args.machine)
    sys.stdout.write(check.to_json() if args.json else f"{check}\n")
    return 0 if check.passed else CHECK_FAILED


def new_effect(args: Namespace) -> int:
    """Write a commented, working example of an effect."""
    name = effects.effect_name(args.file)
    keep(check_new(args, args.file))
    effects.effect_template(name).save(args.file)
    line = command_line("effects", "show", name, *options(effects=args.file))
    print(f"wrote {args.file}\n{hint('read it back', line)}")
    return 0


def draft_effect(args: Namespace) -> int:
    """Write what a diagnosis leaves unexplained as an effect to edit."""
    check_written(args, [args.output])
    replaced = check_new(args, args.output)
    with progress_line(quiet=args.json) as progress:
        draft = effects.draft_effect(
            *measured(args), args.output, progress=progress, **given(args, effects.draft_effect)
        )
    if draft.text:
        keep(replaced, quiet=args.json)
        draft.save(args.output)
    if args.json:
        sys.stdout.write(draft.to_json())
    elif not draft.text:
        print(draft.reason)
    else:
        print("\n".join([draft.diagnosis.to_dict()["portrait"]["text"], f"wrote {args.output}", *draft.next]))
    return 0


MACHINE, EFFECTS = (arguments_of(Machine.load)[name] for name in ("machine", "effects"))
FILE = own("FILE.py", "file with your own physical effects", name="file")
COMMANDS = {
    "effects list": Command(list_effects, EFFECTS, JSON),
    "effects show": Command(show_effect, own("NAME", "name of the effect"), EFFECTS, JSON),
    "effects new": Command(new_effect, FILE, REPLACE),
    "effects draft": Command(
        draft_effect,
        DATA,
        Machine.load,
        Measurements.read,
        effects.draft_effect,
        own("-o --output FILE.toml", "file to write", default="missing.toml"),
        REPLACE,
        JSON,
    ),
    "effects check": Command(check_effects, FILE, MACHINE, JSON),
}
