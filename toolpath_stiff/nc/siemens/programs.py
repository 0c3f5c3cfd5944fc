"""Programs, labels and plain blocks of a file in Siemens' language, found before it runs.

SIEMENS, SINUMERIK 840D sl, Programming Manual Fundamentals, "Structure and contents of an NC program".
"""

import math
import re

from toolpath_stiff.nc.lines import code_text

HEAD = re.compile(r"\s*(/\d?)?\s*(?:N(\d+)|(:\d+))?\s*(/\d?)?\s*(?:([A-Z_]{2}\w*)\s*:(?![=\d])\s*)?", re.ASCII)
PROGRAM = re.compile(r"\s*%_N_(\w+?)_(?:MPF|SPF)\b|\s*(?:N\d+\s+)?PROC\s+(\w+)\s*(.*)", re.ASCII)
PLAIN = re.compile(r"\s*(?:N\d+\s*)?((?:(?:G|[XYZABCIJKFS]=?|CR=)[-+]?[\d.]+\s*)*)(?:;.*)?", re.ASCII | re.IGNORECASE)
MACRO = re.compile(r"\s*(?:N\d+\s*)?DEFINE\s+([A-Z_]{2}\w*)\s+AS\s+(.*)", re.ASCII)
NAMES = re.compile(r'"[^"]*"|\$?[A-Z_]\w*', re.ASCII)
REMARK = re.compile(r"^\s*(?:N\d+\s*)?\([^()]*\)$", re.ASCII)  # a comment as the ISO dialect and some posts write it


def heads_of(lines: tuple[str, ...]) -> list[re.Match[str]]:
    """Skip, number and label at the head of each line, matched in its code; macros are replaced by what they are."""
    macros, heads = dict[str, str](), list[re.Match[str] | None]()
    for line in lines:
        text = REMARK.sub("", code_text(line))
        macro = MACRO.match(text) if "DEFINE" in text else None
        if macro is not None:
            macros[macro[1]] = macro[2]
            text = ""
        elif macros:
            text = NAMES.sub(lambda name: macros.get(name[0], name[0]), text)
        heads.append(HEAD.match(text))
    return [head for head in heads if head is not None]


def labels_of(heads: list[re.Match[str]]) -> dict[str, list[int]]:
    """Lines of each label; block numbers are labels too."""
    labels: dict[str, list[int]] = {}
    for row, head in enumerate(heads):
        for label in (head[5], head[2] and f"N{head[2]}", head[3]):
            labels.setdefault(label or "", []).append(row)
    return labels


def line_of(rows: list[int], ends: set[int], row: int, way: str) -> int | None:
    """Of a label's lines the one that a jump from a line of the same program goes to; None: there is none.

    `ends`: of programs. GOTOF: forward, GOTOB: backward, REPEAT: backward first, others (GOTO): forward first.
    """
    first = max((end for end in ends if end <= row), default=0)
    stop = min((end for end in ends if end > first), default=math.inf)
    ahead = [place for place in rows if row < place < stop]
    behind = [place for place in reversed(rows) if first <= place <= row]
    places = {"GOTOF": ahead, "GOTOB": behind, "REPEAT": behind + ahead}.get(way, ahead + behind)
    return places[0] if places else None


def is_head(head: re.Match[str]) -> bool:
    """True if a line only names the program that begins there."""
    return PROGRAM.match(head.string) is not None or head.string.lstrip()[:1] == "%"


def programs_of(heads: list[re.Match[str]]) -> dict[str, int]:
    """First line of each program: that of its file, or its PROC."""
    programs, opened = dict[str, int](), -1
    for row, head in enumerate(heads):
        program = PROGRAM.match(head.string)
        if program is not None:
            programs.setdefault(program[1] or program[2], opened if program[2] and opened >= 0 else row)
            opened = row
        elif head.string.strip():
            opened = -1
    return programs


def plain_texts(lines: tuple[str, ...], heads: list[re.Match[str]]) -> list[str]:
    """Plain blocks as G code, for the reader of plain lines; "?" for others, and before CT, which needs a direction."""
    texts = list[str]()
    for line, head in zip(lines, heads, strict=True):
        plain = PLAIN.fullmatch(line)
        if re.search(r"\bCT\b", head.string) and texts:
            texts[-1] = "?"
        as_code = plain[1].upper().replace("CR=", "R").replace("=", "") if plain is not None else "?"
        texts.append("?" if head[3] else as_code)
    return texts
