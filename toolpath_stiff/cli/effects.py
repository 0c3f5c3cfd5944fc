"""`tps effects`: the physical effects that a machine can carry, along the load path; a start for one's own."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.cli.arguments import add_json_option
from toolpath_stiff.cli.outputs import add_replace_option, check_new, keep
from toolpath_stiff.hints import command_line, hint, options

if TYPE_CHECKING:
    from toolpath_stiff.stiffness.effects import Effect, Parameter

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
    """List, show or write."""
    if args.action == "new":
        return write_template(args.file, check_new(args, args.file))
    if args.action == "check":
        return check(args)
    from toolpath_stiff.stiffness.effects import find_effect, installed_effects, known_effects

    if args.action == "show":
        effect = find_effect(args.name, args.effects)
        print(_as_json(describe(effect)) if args.json else details(effect))
        return 0
    effects = list(known_effects(args.effects).values())
    broken = installed_effects()[1]
    if args.json:
        print(_as_json({"effects": [describe(effect) for effect in effects], "broken": broken}))
    else:
        print(table(effects, broken))
    return 0


def check(args: argparse.Namespace) -> int:
    """Try every effect of a file; exit code 1 if one fails."""
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.stiffness.effects import effects_from_file, known_effects
    from toolpath_stiff.stiffness.effects.trial import try_effect

    machine = load_machine(args.machine)
    known_effects([args.file])  # names that are taken
    trials = [try_effect(effect, machine) for effect in effects_from_file(args.file).values()]
    good = all(trial.passed for trial in trials)
    if args.json:
        rows = [
            {"effect": t.effect.name, "passed": t.passed, "checks": [vars(outcome) for outcome in t.outcomes]}
            for t in trials
        ]
        print(_as_json({"file": args.file, "machine": machine.name, "passed": good, "effects": rows}))
        return 0 if good else CHECK_FAILED
    words = {True: "good", False: "FAILS", None: "note"}
    for trial in trials:
        print(f"{trial.effect.name}, on machine {machine.name}: {'good' if trial.passed else 'FAILS'}")
        width = max(len(outcome.name) for outcome in trial.outcomes)
        for outcome in trial.outcomes:
            print(f"  {words[outcome.passed]:<5}  {outcome.name:<{width}}  {outcome.found}")
    return 0 if good else CHECK_FAILED


def describe(effect: Effect) -> dict[str, object]:
    """What the effect declares, in its own units; JSON has no infinity, so that "inf" stands for it."""
    return {
        "name": effect.name,
        "title": effect.title,
        "link": effect.link,
        "equation": effect.equation,
        "source": effect.source,
        "load_dependent": effect.load_dependent,
        "needs": list(effect.needs),
        "parameters": [
            {
                "name": p.name,
                "key": p.key,
                "unit": p.unit,
                "bounds": [_json_number(value) for value in p.bounds],
                "typical": [_json_number(value) for value in p.typical],
                "neutral": _json_number(p.neutral),
                "kind": p.kind,
                "meaning": p.meaning,
                "source": p.source,
            }
            for p in effect.parameters
        ],
    }


def table(effects: list[Effect], broken: dict[str, str]) -> str:
    """One line an effect: link, name, title, parameters with their units; then the plug-ins that do not load."""
    rows = [("link", "name", "title", "parameters")]
    for effect in effects:
        parameters = ", ".join(f"{p.name} ({p.unit})" if p.unit else p.name for p in effect.parameters)
        rows.append((effect.link, effect.name, effect.title, parameters or "-"))
    widths = [max(len(row[i]) for row in rows) for i in range(4)]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    if broken:
        lines += ["", "plug-ins that do not load:"]
        lines += [f"  {name}: {reason}" for name, reason in broken.items()]
    return "\n".join(lines)


def details(effect: Effect) -> str:
    """The whole effect, for people, with the lines for a machine file."""
    lines = [
        f"{effect.name}: {effect.title}",
        f"  link       {effect.link}",
        f"  equation   {effect.equation}",
        f"  source     {effect.source}",
    ]
    if effect.load_dependent:
        lines.append("  load       depends on the size of the load (--force): the stiffness is the secant one")
    if effect.needs:
        lines.append(f"  needs      columns {', '.join(effect.needs)} in the measurements")
    for p in effect.parameters:
        lines += ["", f"  {p.key}", f"    meaning  {p.meaning or p.name}"]
        if p.discrete:
            lines += [f"    value    {p.expected}; chosen, not fitted", f"    source   {p.source}"]
            continue
        lines += [
            f"    bounds   {_range(p.bounds, p)}",
            f"    typical  {_range(p.typical, p)}",
            f"    source   {p.source}",
            f"    neutral  {p.neutral:g}",
        ]
    kind = "instrument" if effect.is_instrument else "effect"
    lines += ["", "In a machine file:", f"  [[{kind}]]", f'  name = "{effect.name}"']
    lines += [f'  {p.key} = ""' if p.kind == "text" else f"  {p.key} = {p.typical[0]:g}" for p in effect.parameters]
    return "\n".join(lines)


def write_template(file: str, replaced: Sequence[Path] = ()) -> int:
    """Write the example effect, named after its file; `replaced` is kept."""
    from importlib import resources

    from toolpath_stiff.errors import InputError
    from toolpath_stiff.files import write_atomically

    target = Path(file)
    name = target.stem
    if target.suffix != ".py" or not name.isidentifier():
        raise InputError(f"{file!r} cannot hold an effect", expected="a name such as my_screw.py")
    text = (resources.files("toolpath_stiff") / "data" / "templates" / "effect.py.txt").read_text("utf-8")
    keep(replaced)
    write_atomically(target, text.replace("EFFECT_NAME", name).replace("EFFECT_FILE", target.name))
    print(f"wrote {file}\n{hint('read it back', command_line('effects', 'show', name, *options(effects=file)))}")
    return 0


def _range(values: tuple[float, float], parameter: Parameter) -> str:
    return f"{values[0]:g} to {values[1]:g} {parameter.unit}".rstrip()


def _json_number(value: float) -> float | str:
    return value if math.isfinite(value) else str(value)


def _as_json(value: object) -> str:
    return json.dumps(value, indent=2, ensure_ascii=False, allow_nan=False)
