"""Comment lines of a program that head an operation, as CAM posts and people write them.

What posts write was looked up in published programs: of Fusion 360 (one line before each operation; tools, notes on the
licence in the header), FreeCAD (`begin operation: NAME`, `finish operation: NAME`), Mastercam (tool and name in one
block), Vectric (`Toolpath:- NAME` between lines of dashes), Estlcam, CamBam, jscut, Gcodetools, bCNC, pcb2gcode, and
five-axis demos of LinuxCNC.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

NAMED, MARKED, TOOL = "named", "marked", "tool"

COMMENTS = re.compile(r"\(([^()]*)\)?|;(.*)")
NO_WORDS = re.compile(r"\s*+(?:N\s*+\d++\s*+)?", re.IGNORECASE)  # a line number is no word
BEGINS = re.compile(r"\s*+(?:N\s*+\d++\s*+)?[(;]", re.IGNORECASE)
ACTIVE = re.compile(r"\s*(?:MSG|DEBUG|PRINT)\s*,", re.IGNORECASE)  # LinuxCNC shows what follows
FRAME, DASHES = " *=#~|'\"", "-_."  # of dashes and points only two and more are a frame: -X SIDE, .5 CHAMFER
MARK = re.compile(
    r"(?:(?:begin|start)\s+(?:of\s+)?(?:operation|section|toolpath|cutting\s+path\s+id)|tool\s?path(?:\s+name)?"
    r"|operation(?:\s+name)?|block-name)\s*(?::-?|=)\s*(?=.*\w)",
    re.IGNORECASE,
)
FIELD = re.compile(r"(?:name|type)\s*:\s*(?=.*\w)", re.IGNORECASE)  # after `Operation: 0`
TOOL_LINE = re.compile(r"(?:T\s*\d+|tools?|change\s+(?:to\s+)?tool)\b|.*\btool\s*-\s*\d", re.IGNORECASE)
TOOL_NUMBERS = re.compile(r"\s*\btool\s*-\s*\d+\s*|\s*\b(?:tool\s+)?dia\.\s*off\..*$", re.IGNORECASE)
# The end of something, the state of a post, single moves, licence notes, code that is commented out: no headings.
NOTHING = re.compile(
    r"(?:finish(?:ed)?|end)\s+(?:of\s+)?(?:the\s+)?(?:op|operation|section|tool\s?path|cutting|path|preamble)\b"
    r"|.*\b(?:done|finished|completed)$"
    r"|(?:begin|start)\s+(?:of\s+)?(?:preamble|tool\s?change)\b|tool\s?change$|(?:section|start|stop|end)\s+(?:begin|end)$"
    r"|(?:plunge|cut|cutting|retract|approach|ramp|penetrate|lead[\s-]?(?:in|out))$|(?:rapid|retract|move|go)\s+to\b"
    r"|(?:pass\s+\d+\s+)?path\s+\d+$|.*\bmove\s+(?:starts|ends)$|machine\s+group-\d+$"
    r"|(?:MOVEMENT|COMMAND)_\w+$|>>>|block-(?:expand|enable)\b|[XYZ]\s+min\b|when\s+using\s+fusion\b"
    r"|(?:[A-Z]\s*[-+]?(?:\d++\.?\d*+|\.\d++)\s*)++(?:;.*)$|(?:[A-Z]\s*[-+]?(?:\d++\.?\d*+|\.\d++)\s*){2,}+$"
    r"|[A-Z]\s*[-+]?(?:\d++\.\d*+|\.\d++)$",  # an axis and where it stands; M8 may be a hole
    re.IGNORECASE,
)
FROM_HERE_NOTES = re.compile(r"when\s+using\s+fusion\b", re.IGNORECASE)  # the rest of its block is its sentence


class Heading(NamedTuple):
    """A block of comment lines: its first line, its name, and what the name is: NAMED, MARKED (by the post) or TOOL."""

    line: int
    name: str
    kind: str


def split_comments(text: str) -> tuple[str, str]:
    """The code of a line and its comments, joined."""
    return COMMENTS.sub(" ", text), " ".join(first or second for first, second in COMMENTS.findall(text))


def headings(lines: Sequence[str]) -> list[Heading]:
    """Blocks of successive lines that hold comments alone, in order; those that name nothing are left out."""
    found: list[Heading] = []
    block: list[str] = []
    first = last = -1
    for number, text in enumerate(lines, 1):
        if ("(" not in text and ";" not in text) or not BEGINS.match(text):
            continue
        code, comment = split_comments(text)
        if not NO_WORDS.fullmatch(code):
            continue
        if number != last + 1:
            _close(found, first, block)
            block, first = [], number
        block.append(comment)
        last = number
    _close(found, first, block)
    return found


def _close(found: list[Heading], first: int, block: list[str]) -> None:
    heading = heading_of(block, first)
    if heading is not None:
        found.append(heading)


def heading_of(block: Sequence[str], line: int) -> Heading | None:
    """What a block of comments names: what the post marks, else the first line with letters, else a tool."""
    named = tool = number = None
    for comment in block:
        name = plain_name(comment)
        mark = MARK.match(name)
        if mark is not None:
            marked = plain_name(name[mark.end() :])
            if any(map(str.isalpha, marked)):
                return Heading(line, marked, MARKED)
            number = name
        field = FIELD.match(name)
        if number and field is not None:
            return Heading(line, plain_name(name[field.end() :]), MARKED)
        if FROM_HERE_NOTES.match(name):
            break
        if NOTHING.match(name) or not any(map(str.isalpha, name)):
            continue
        if TOOL_LINE.match(name):
            tool = tool or TOOL_NUMBERS.sub("", name) or name
        else:
            named = named or name
    if number is not None:
        return Heading(line, number, MARKED)
    if named is None:
        return None if tool is None else Heading(line, tool, TOOL)
    return Heading(line, named, NAMED)


def plain_name(comment: str) -> str:
    """A comment without what frames it: blanks, asterisks, dashes; the text alone of `MSG, text`."""
    active = ACTIVE.match(comment)
    text = " ".join((comment[active.end() :] if active else comment).split())
    inside = text.lstrip(FRAME + DASHES)
    text = _last_dash(text[: len(text) - len(inside)]) + inside
    inside = text.rstrip(FRAME + DASHES)
    return inside + _last_dash(text[len(inside) :][::-1])


def _last_dash(frame: str) -> str:
    """The dash or point next to the text, if it stands alone: it belongs to the text."""
    return frame[-1:] if frame and frame[-1] in DASHES and frame[-2:-1] not in tuple(DASHES) else ""
