"""Physical effects: listed, shown, written, tried.

for example:
  tps effects list
  tps effects show platform_flexibility
  tps effects new my_screw.py            a working effect to change into yours
  tps effects draft measurements.csv -o missing.toml  what a diagnosis leaves unexplained, as an effect to edit
  tps effects check my_screw.py          shapes, symmetry, units, neutral value, speed; exit code 1 if it fails
  tps effects list --effects my_screw.py

Machine files carry effects as [[effect]], those that act on readings as [[instrument]].
"""

from argparse import Namespace
from pathlib import Path
from typing import Annotated

import toolpath_stiff as tps
from toolpath_stiff.api.effects import effect_name
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import DATA, JSON, REPLACE, command
from toolpath_stiff.hints import options
from toolpath_stiff.options import Option, arguments_of
from toolpath_stiff.report.effects import describe_effect, effect_details
from toolpath_stiff.stiffness.catalogue import find_effect

CHECK_FAILED = 1
MACHINE, EFFECTS = (arguments_of(tps.Machine.load)[name] for name in ("machine", "effects"))
File = Annotated[str, Option("FILE.py", help="file with your own physical effects")]


@command("effects list", "effects", EFFECTS, JSON)
def list_effects(args: Namespace) -> int:
    """All effects, in the order of the load path."""
    return run.show(args, tps.effects(args.effects, kind=args.kind))


@command("effects show", EFFECTS, JSON)
def show_effect(args: Namespace, name: Annotated[str, Option("NAME", help="name of the effect")]) -> int:
    """Equation, parameters, units, bounds, typical values and their source."""
    effect = find_effect(name, args.effects)
    return run.show(args, effect_details(effect), document=lambda: describe_effect(effect))


@command("effects new", REPLACE)
def new_effect(args: Namespace, file: File) -> int:
    """Write a commented, working example of an effect."""
    name = effect_name(file)
    text, show_it = tps.effect_template(name).text, ("effects", "show", name, *options(effects=file))
    return run.write_text(args, file, text, "read it back", *show_it, fresh=True)


@command("effects draft", DATA, "Machine.load", "Measurements.read", "draft_effect", REPLACE, JSON)
def draft_effect(
    args: Namespace,
    output: Annotated[str, Option("-o --output", "FILE.toml")] = "missing.toml",
) -> int:
    """Write what a diagnosis leaves unexplained as an effect to edit.

    Parameters
    ----------
    output
        File to write.
    """
    draft = run.call(args, tps.draft_effect, file=output)
    if not draft.text:
        return run.show(args, draft)
    run.write_single(args, {Path(output): draft.text}, fresh=True)
    lines = [draft.diagnosis.to_dict()["portrait"]["text"], f"wrote {output}", *draft.next]
    return run.show(args, "\n".join(lines), document=draft.to_dict)


@command("effects check", MACHINE, JSON)
def check_effects(args: Namespace, file: File) -> int:
    """Try the effects of a file against the contract; exit code 1 if one fails."""
    check = tps.check_effects(file, args.machine)
    return run.show(args, check, code=0 if check.passed else CHECK_FAILED)
