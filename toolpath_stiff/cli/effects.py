"""The command on physical effects."""

from __future__ import annotations

from argparse import Namespace

import toolpath_stiff as tps
from toolpath_stiff.api.effects import effect_name
from toolpath_stiff.cli.calls import call
from toolpath_stiff.cli.outputs import check_new, check_single, keep, show
from toolpath_stiff.cli.parser import DATA, JSON, REPLACE, Command, own
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
    return show(args, tps.effects(args.effects))


def show_effect(args: Namespace) -> int:
    """Equation, parameters, units, bounds, typical values and their source."""
    from toolpath_stiff.report.effects import describe_effect, effect_details
    from toolpath_stiff.stiffness.catalogue import find_effect

    effect = find_effect(args.name, args.effects)
    return show(args, effect_details(effect), document=lambda: describe_effect(effect))


def check_effects(args: Namespace) -> int:
    """Try the effects of a file against the contract; exit code 1 if one fails."""
    check = tps.check_effects(args.file, args.machine)
    show(args, check)
    return 0 if check.passed else CHECK_FAILED


def new_effect(args: Namespace) -> int:
    """Write a commented, working example of an effect."""
    name = effect_name(args.file)
    keep(check_new(args, args.file))
    tps.effect_template(name).save(args.file)
    line = command_line("effects", "show", name, *options(effects=args.file))
    print(f"wrote {args.file}\n{hint('read it back', line)}")
    return 0


def draft_effect(args: Namespace) -> int:
    """Write what a diagnosis leaves unexplained as an effect to edit."""
    check_single(args, args.output)
    replaced = check_new(args, args.output)
    draft = call(args, tps.draft_effect, file=args.output)
    if not draft.text:
        return show(args, draft)
    keep(replaced, quiet=args.json)
    draft.save(args.output)
    lines = [draft.diagnosis.to_dict()["portrait"]["text"], f"wrote {args.output}", *draft.next]
    return show(args, "\n".join(lines), document=draft.to_dict)


MACHINE, EFFECTS = (arguments_of(tps.Machine.load)[name] for name in ("machine", "effects"))
FILE = own("FILE.py", "file with your own physical effects", name="file")
COMMANDS = {
    "effects list": Command(list_effects, EFFECTS, JSON),
    "effects show": Command(show_effect, own("NAME", "name of the effect"), EFFECTS, JSON),
    "effects new": Command(new_effect, FILE, REPLACE),
    "effects draft": Command(
        draft_effect,
        DATA,
        tps.Machine.load,
        tps.Measurements.read,
        tps.draft_effect,
        own("-o --output FILE.toml", "file to write", default="missing.toml"),
        REPLACE,
        JSON,
    ),
    "effects check": Command(check_effects, FILE, MACHINE, JSON),
}
