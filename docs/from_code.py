"""What the pages hold that the code knows: effects, codes, words, commands, the public API.

A page marks the place with two comments, `<!-- NAME: made by ... -->` and `<!-- end of NAME -->`. Sphinx fills it while
it reads the page; `python docs/from_code.py` writes the parts of `COMMITTED` into the pages themselves, for GitHub.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).parents[1]))

import toolpath_stiff
from toolpath_stiff.nc.codes.code import EVERYWHERE, Code, holds_anyway
from toolpath_stiff.nc.codes.registry import CODES, REFUSED
from toolpath_stiff.nc.cutter_location.vocabulary import DOUBTFUL, LISTED, READ, WORDS
from toolpath_stiff.nc.cutter_location.vocabulary import REFUSED as REFUSED_WORD
from toolpath_stiff.nc.heidenhain import functions as tnc
from toolpath_stiff.nc.heidenhain import vocabulary as plain_language
from toolpath_stiff.nc.siemens import vocabulary as siemens
from toolpath_stiff.rig.fem_faults import FAULTS
from toolpath_stiff.rig.unknowns import UNKNOWNS
from toolpath_stiff.stiffness.catalogue import effects_of_elements, packaged_effects
from toolpath_stiff.stiffness.contract import LINKS, Effect, Parameter

DOCS = Path(__file__).parent
API, COMMANDS = DOCS / "api", DOCS / "commands"  # a page for each public name and command, made and git-ignored
HELP_WIDTH = 90


def fill(text: str, parts: dict[str, Callable[[], str]]) -> str:
    """A page with each part that it marks made anew."""
    for name, make in parts.items():
        place = re.compile(rf"(<!-- {name}: made by .*? -->).*(<!-- end of {name} -->)", re.DOTALL)
        if place.search(text):
            made = f"\n\n{make().strip()}\n\n"
            text = place.sub(lambda found, made=made: f"{found[1]}{made}{found[2]}", text)
    return text


def rows(*lines: Iterable[str]) -> Iterator[str]:
    """Lines of a Markdown table; the first are its headings."""
    for number, cells in enumerate(lines):
        row = [cell.replace("|", r"\|") for cell in cells]
        yield f"| {' | '.join(row)} |"
        if number == 0:
            yield f"|{' --- |' * len(row)}"


# Codes

NOT_THERE = "has none"
# LinuxCNC's, and in no program whose path is compared with LinuxCNC's. The others are in such programs: the random ones
# of `benchmarks/hunt.md`, or those of the tests against rs274 (`tests/nc/test_code_registry.py` looks them up).
WITHOUT_WITNESS = ("M7", "M19", "M53")


def codes_table() -> str:
    """The codes that are understood, their other names, and those that are refused, as Markdown tables."""
    understood = [
        (code.name, code.group, f"{code.meaning} (listed: {code.listed})" if code.listed else code.meaning,
         _function(code), _controls(code.controls), code.source, _witness(code))
        for code in CODES.values()
    ]  # fmt: skip
    refused = [(code.name, code.what, code.hint, code.source) for code in REFUSED.values()]
    heading = ("code", "group", "meaning", "function in `nc/codes`", "dialects", "source", "against LinuxCNC")
    others = "Refused in every dialect, with the line and what to do instead; nothing is held against LinuxCNC:"
    tables = [*rows(heading, *_joined(understood)), "", others, ""]
    return "\n".join([*tables, *rows(("code", "what it is", "instead", "source"), *_joined(refused)), ""])


# Statements of Heidenhain's language in random programs that an independent reader reads too; the test looks them up.
HUNTED = (
    "L", "LP", "CC", "C", "CP", "CR", "CT", "CHF", "RND", "CYCL DEF 7.1", "CYCL DEF 8.1", "CYCL DEF 10.1",
    "CYCL DEF 11.1",
    "CYCL DEF 14.1", "CYCL DEF 20", "CYCL DEF 22", "CYCL DEF 24", "CYCL DEF 25",
    "CYCL DEF 200", "CYCL DEF 201", "CYCL DEF 207", "PLANE SPATIAL", "PLANE RESET", "LBL", "CALL LBL",
    "FN12", "Q", "CYCL DEF 208", "CYCL DEF 251", "CYCL DEF 252", "CYCL DEF 253", "CYCL DEF 256", "CYCL DEF 257", "FL",
    "FLT", "FCT", "PATTERN DEF", "CYCL CALL PAT", "TOOL DEF",
)  # fmt: skip
UNHELD = ("BEGIN PGM", "END PGM", "FUNCTION RESET TCPM", "M")


def statements_table() -> str:
    """Heidenhain's statements and M functions, with what holds each of them; and those that are refused."""
    table = plain_language.STATEMENTS.values()
    rows_ = [(row.name, row.meaning, _language_function(row), row.source, _held(row)) for row in table]
    listed = [(name, f"{what} (listed)", "", "as M functions", "") for name, what in tnc.PASSIVE.items()]
    own = [(name, what, "", "as M functions", "geometry by hand") for name, what in plain_language.OWN.items()]
    cells = [*_joined(rows_), *_joined(own), *_joined(listed)]
    refused = [(row.name, row.what, row.hint, row.source) for row in plain_language.REFUSED.values()]
    refused += [(name, what, "", "as M functions") for name, what in tnc.REFUSED.items()]
    heading = ("statement", "meaning", "function in `nc/heidenhain`, `nc/contouring`", "source", "held by")
    below = rows(("statement", "what it is", "instead", "source"), *_joined(refused))
    return "\n".join([*rows(heading, *cells), "", "Refused, with the line:", "", *below, ""])


# Of Siemens' words those in random programs that an independent reader reads too.
HUNTED_SIEMENS = (
    "G0", "G1", "G2", "G3", "CIP", "CT", "G90", "G91", "G111", "TRANS", "ATRANS", "ROT", "AROT", "MIRROR", "AMIRROR",
    "ASCALE", "CYCLE800", "CYCLE81", "CYCLE82", "CYCLE83", "CYCLE85", "CYCLE89", "MCALL", "HOLES2", "M17", "M30",
)  # fmt: skip
UNHELD_SIEMENS = ("G53", "G153", "KONT", "NORM", "G450", "G451", "CSPLINE", "G74")


def siemens_table() -> str:
    """Siemens' words, with what holds each of them; and those that are refused."""
    cells = []
    for code in siemens.TABLE.values():
        unheld = code.listed or code.controls == EVERYWHERE or code.name in UNHELD_SIEMENS
        held = "" if unheld else "geometry by hand"
        held = "geometry by hand; independent reader" if code.name in HUNTED_SIEMENS else held
        meaning = f"{code.meaning} (listed)" if code.listed else code.meaning
        if not re.fullmatch(r"G5(0[6-9]|[1-8]\d|9[0-8])", code.name):  # G505 to G599 are one
            cells.append((code.name, meaning, _language_function(code), code.source, held))
    refused = _joined((row.name, row.what, row.hint, row.source) for row in siemens.REFUSED.values())
    below = rows(("word", "what it is", "instead", "source"), *refused)
    heading = ("word", "meaning", "function", "source", "held by")
    return "\n".join([*rows(heading, *_joined(cells)), "", "Refused, with the line:", "", *below, ""])


def _language_function(code: Code) -> str:
    return "" if code.act in (tnc.nothing, tnc.listed, holds_anyway) else _function(code)


def _held(code: Code) -> str:
    if code.act is tnc.listed or code.name in UNHELD:
        return ""
    return "geometry by hand; independent reader" if code.name in HUNTED else "geometry by hand"


def _joined(cells: Iterable[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Rows of a table; those that differ in their code alone are one."""
    names: dict[tuple[str, ...], list[str]] = {}
    for name, *others in cells:
        names.setdefault(tuple(others), []).append(name)
    for others_, codes in names.items():
        yield (" ".join(codes), *others_)


def _witness(code: Code) -> str:
    """Whether what the code does is held against LinuxCNC's interpreter."""
    if "linuxcnc" not in code.controls or "LinuxCNC" not in code.source:
        return NOT_THERE
    return "not held" if code.name in WITHOUT_WITNESS else "same path"


def _function(code: Code) -> str:
    module = code.act.__module__.rsplit(".", maxsplit=1)[-1]
    return "" if code.act is holds_anyway else f"`{module}.{code.act.__name__}`"


def _controls(names: tuple[str, ...]) -> str:
    return "all" if names == EVERYWHERE else ", ".join(names)


# Effects


def words_table() -> str:
    """The words of cutter-location files as a Markdown table: neighbours with the same meaning share a row."""
    order = (READ, LISTED, DOUBTFUL, REFUSED_WORD)
    words = sorted(WORDS.values(), key=lambda word: order.index(word.kind))
    table = [("words", "taken for", "", "written by", "source")]
    for cells, group in groupby(words, lambda word: (word.meaning, word.kind, word.written_by, word.source)):
        table.append((" ".join(f"`{word.name}{word.form}`" for word in group), *cells))
    return "\n".join([*rows(*table), ""])


def effects_table() -> str:
    """One row for each packaged effect, along the load path."""
    found = [(f"[`{effect.name}`](#{effect.name})", effect.link, effect.title, _keys(effect)) for effect in _effects()]
    return "\n".join(rows(("effect", "link", "what it is", "parameters and their bounds"), *found))


def effects_in_full() -> str:
    """A section for each packaged effect: what it is, equation, needs, parameters with the source of their sizes."""
    return "\n\n".join(_effect(effect) for effect in _effects())


def _effects() -> list[Effect]:
    return sorted(
        {**packaged_effects(), **effects_of_elements()}.values(),
        key=lambda effect: (LINKS.index(effect.link), effect.name),
    )


def _keys(effect: Effect) -> str:
    return "; ".join(f"`{p.key}` {_bounds(p)}" for p in effect.parameters)


def _bounds(p: Parameter) -> str:
    return "a name" if p.kind == "text" else f"{_number(p.bounds[0])} to {_number(p.bounds[1])}"


def _number(value: float) -> str:
    return f"{value:g}".replace("e+0", "e")


def _effect(effect: Effect) -> str:
    about = " ".join((inspect.getdoc(type(effect)) or "").split("\n\n")[0].split())
    further = (inspect.getdoc(type(effect)) or "").split("\n\n")[1:]
    lines = [f"### {effect.name}", "", about]
    for paragraph in further:
        lines += ["", " ".join(paragraph.split())]
    lines += ["", f"Equation: `{effect.equation}`. Source: {effect.source}."]
    if effect.holds_for == "elements":
        lines += [
            "",
            "It holds for [machines of elements](machines.md#other-kinds-of-machines): mills, deltas, robots.",
        ]
    if effect.load_dependent:
        lines += ["", "It depends on the size of the load (`--force`); the stiffness is the secant one."]
    if effect.needs:
        columns = ", ".join(f"`{name}`" for name in effect.needs)
        lines += ["", f"It needs {columns}: [conditions](effects.md#conditions-of-an-effect)."]
    table = [("key", "meaning", "bounds", "typical", "source of the typical size")]
    table += [
        (f"`{p.key}`", p.meaning or p.name, _bounds(p), "chosen" if p.discrete else _typical(p), p.source)
        for p in effect.parameters
    ]
    return "\n".join([*lines, "", *rows(*table)])


def _typical(p: Parameter) -> str:
    return f"{_number(p.typical[0])} to {_number(p.typical[1])} {p.unit}".rstrip()


def unknowns_table() -> str:
    """One row for each unknown of the rig: its physics, what a description may name, what its readings must carry."""
    found = []
    for name, kind in UNKNOWNS.items():
        physics = kind.act or kind.read or kind.move
        about = " ".join((inspect.getdoc(physics) or "").split("\n\n")[0].split())
        columns = ", ".join(f"`{column}`" for column in kind.columns)
        found.append((f"`{name}`", about, ", ".join(sorted(kind.links)), ", ".join(sorted(kind.variables)), columns))
    return "\n".join(rows(("unknown", "physics", "links", "varies with", "needs"), *found))


def faults_table() -> str:
    """One row for each fault of the machine of finite elements."""
    cells = [
        (", ".join(sorted(part)) for part in (fault.links, fault.names, (f"`{column}`" for column in fault.columns)))
        for fault in FAULTS.values()
    ]
    table = ((f"`{name}`", *words) for name, words in zip(FAULTS, cells, strict=True))
    return "\n".join(rows(("fault", "links", "in the catalogue", "needs"), *table))


# Commands


def commands() -> str:
    """Tables of the commands by group, each with what it does, leading to its page."""
    from toolpath_stiff.cli.main import GROUPS

    lines: list[str] = []
    for group, names in GROUPS.items():
        table = ((f"[`tps {name}`](commands/{name}.md)", _sentence(about)) for name, about in names.items())
        lines += [f"## {group.capitalize()}", "", *rows(("command", "what it does"), *table), ""]
        lines += _hidden_toctree(f"commands/{name}" for name in names)
    return "\n".join(lines)


def command_pages() -> dict[str, str]:
    """A page for each command: itself or its actions, with usage and options, from the parsers themselves."""
    from toolpath_stiff.cli.main import GROUPS, actions_of

    pages = {}
    for name, about in (row for names in GROUPS.values() for row in names.items()):
        actions = actions_of(name)
        lines = [] if name in actions else [f"# tps {name}", "", _sentence(about), ""]
        for title, command in actions.items():
            alone = title == name
            lines += _command(command.parser(f"tps {title}"), about if alone else "", 1 if alone else 2)
        pages[f"{name}.md"] = "\n".join(lines)
    return pages


def _hidden_toctree(pages: Iterable[str]) -> list[str]:
    return ["```{toctree}", ":hidden:", "", *pages, "```", ""]


def _sentence(text: str) -> str:
    return f"{_escaped(text[:1].upper() + text[1:])}."


def _command(parser: argparse.ArgumentParser, about: str, level: int) -> list[str]:
    formatter = argparse.HelpFormatter(parser.prog, width=HELP_WIDTH)
    formatter.add_usage(parser.usage, parser._actions, parser._mutually_exclusive_groups)
    about = about or (parser.description or "").rstrip(".")
    lines = ["#" * level + " " + parser.prog, "", _sentence(about), ""]
    lines += ["```text", formatter.format_help().strip(), "```", ""]
    for group in parser._action_groups:
        lines += _options(group, formatter)
    if parser.epilog:
        lines += ["```text", parser.epilog.strip(), "```", ""]
    return lines


def _options(group: argparse._ArgumentGroup, formatter: argparse.HelpFormatter) -> list[str]:
    """Definitions of a group's options; what every command has, and the actions, are left out."""
    lines = []
    for action in group._group_actions:
        if not action.help or isinstance(action, argparse._HelpAction):
            continue
        lines += [f"`{formatter._format_action_invocation(action)}`"]
        lines += [f": {_escaped(formatter._expand_help(action))}", ""]
    if lines and group.title not in ("options", "positional arguments", "optional arguments"):
        lines[:0] = [f"**{_escaped(str(group.title))}**", ""]
    return lines


def _escaped(text: str) -> str:
    """Plain text, safe within Markdown; what stands between backticks stays code."""
    parts = re.split(r"(`[^`]*`)", " ".join(text.split()))
    return "".join(part if part.startswith("`") else re.sub(r"([\\*_<>\[\]$#|{}])", r"\\\1", part) for part in parts)


# The public API


def api() -> str:
    """Tables of the public names by kind, each with the first line of its docstring."""
    lines: list[str] = []
    for kind, names in _public().items():
        lines += [f"## {kind}", ""]
        lines += rows(("name", "what it is"), *((f"[`{name}`](api/{name}.md)", _summary(name)) for name in names))
        lines += ["", *_hidden_toctree(f"api/{name}" for name in names)]
    return "\n".join(lines)


def _public() -> dict[str, list[str]]:
    """The names of `toolpath_stiff.__all__` by kind."""
    kinds: dict[str, list[str]] = {"What goes in": [], "Functions": [], "Results": [], "Errors": []}
    for name in toolpath_stiff.__all__:
        value = getattr(toolpath_stiff, name)
        if inspect.isclass(value):
            ancestors = {base.__name__ for base in value.__mro__}
            kinds["Errors" if "TpsError" in ancestors else "Results" if "Result" in ancestors else "What goes in"] += [
                name
            ]
        elif callable(value):
            kinds["Functions"].append(name)
    return {kind: names for kind, names in kinds.items() if names}


def _summary(name: str) -> str:
    return " ".join((inspect.getdoc(getattr(toolpath_stiff, name)) or "").split("\n\n")[0].split())


def write_pages(app: Any) -> None:
    """One page for each public name and for each command; those of what is gone are removed."""
    names = {f"{name}.md": _page(name, kind) for kind, names in _public().items() for name in names}
    for folder, pages in ((API, names), (COMMANDS, command_pages())):
        folder.mkdir(exist_ok=True)
        for old in folder.glob("*.md"):
            if old.name not in pages:
                old.unlink()
        for file, text in pages.items():
            if not (folder / file).exists() or (folder / file).read_text("utf-8") != text:
                (folder / file).write_text(text, "utf-8")


def _page(name: str, kind: str) -> str:
    directive = {"Functions": "autofunction", "Errors": "autoexception"}.get(kind, "autoclass")
    options = {"Results": "   :inherited-members:\n", "Errors": "   :show-inheritance:\n"}.get(kind, "")
    return f"# {name}\n\n```{{eval-rst}}\n.. {directive}:: toolpath_stiff.{name}\n{options}```\n"


COMMITTED: dict[str, Callable[[], str]] = {
    "codes": codes_table,
    "words": words_table,
    "statements": statements_table,
    "siemens": siemens_table,
    "table of effects": effects_table,
    "effects": effects_in_full,
    "unknowns": unknowns_table,
    "faults": faults_table,
}
MADE = {**COMMITTED, "commands": commands, "api": api}


def on_docstring(app: Any, what: str, name: str, value: object, options: Any, lines: list[str]) -> None:
    """Put the first line of a property together again: napoleon takes what stands before a colon for its type."""
    for number, line in enumerate(lines if what == "property" else []):
        if line.startswith(":type: "):
            lines[0] = f"{line.removeprefix(':type: ')}: {lines[0]}"
            del lines[number]
            return


def on_signature(app: Any, what: str, name: str, value: object, *_: object) -> tuple[str, None] | None:
    """Results are made by functions, so that how they are called does not matter to a reader."""
    return ("", None) if what == "class" and name.rsplit(".", 1)[-1] in _public().get("Results", []) else None


def on_source_read(app: Any, docname: str, source: list[str]) -> None:
    """Fill a page as Sphinx reads it."""
    source[0] = fill(source[0], MADE)


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.connect("builder-inited", write_pages)
    app.connect("source-read", on_source_read)
    app.connect("autodoc-process-docstring", on_docstring, priority=600)  # after napoleon
    app.connect("autodoc-process-signature", on_signature)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def main() -> None:
    """Write the committed parts into their pages."""
    for page in sorted(DOCS.glob("*.md")):
        text = page.read_text("utf-8")
        made = fill(text, COMMITTED)
        if made != text:
            page.write_text(made, "utf-8")
            print(f"wrote {page.relative_to(DOCS.parent)}")


if __name__ == "__main__":
    main()
