"""The copy of a program that `rs274` gets: no comments, no blanks, and N words that are the physical line numbers.

Comments are how LinuxCNC is told to run Python, to open files and to talk; none reaches it but `(abort,...)`, which
ends a program. Lines keep their places, so that a line number in one of its messages is that of the file.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from toolpath_stiff.errors import InputError

LONGEST_LINE = 250  # rs274 reads at most 255 characters (LINELEN, interp_internal.hh)
LINE_NUMBER = re.compile(r"N[0-9]+(\.[0-9]+)?")
NAMED = re.compile(r"<[^<>]*>")
ABORT = "abort,"
NO_COMMENTS: tuple[tuple[int, str], ...] = ()
# Where the line that asks for a move is not the one that rs274 is reading when it prints it (cutter compensation holds
# moves back), or where more than the move is wanted from its line: cycles, machine coordinates, computed G codes.
NEEDS_TAGS = re.compile(r"G(?:4[12]|7[346]|8[1-9]|0*53|28|30|33|[\[#A-Z])")


@dataclass(frozen=True)
class Line:
    """A line of the program: its words without blanks, in upper case, and its comments with their columns."""

    number: int
    words: str
    comments: tuple[tuple[int, str], ...] = ()
    optional: bool = False

    @property
    def plain(self) -> str:
        """The words without names in angle brackets and without bracketed expressions."""
        return without_expressions(NAMED.sub("<>", self.words))


def split(lines: Iterable[str], name: str) -> list[Line]:
    """Words and comments of every line. Raises `InputError` for a comment that is not closed, or foreign letters."""
    return [_split_line(text, number, name) for number, text in enumerate(lines, 1)]


def _split_line(text: str, number: int, name: str) -> Line:
    if not any(mark in text for mark in "(;)"):
        words, comments = text, NO_COMMENTS
    else:
        words, comments = _cut_comments(text, number, name)
    compact = "".join(words.replace("\ufeff", "").split())
    if not compact.isascii():  # before upper case: of other scripts some letters become ASCII ones
        foreign = next(c for c in words if not c.isascii() and not c.isspace() and c != "\ufeff")
        raise InputError(
            f"{foreign!r} outside a comment",
            expected="letters and digits of the NC language",
            file=name,
            line=number,
            column=words.index(foreign) + 1,
        )
    compact = compact.upper()
    optional = compact.startswith("/")
    if optional:
        compact = compact[1:].lstrip("0123456789")
    return Line(
        number, LINE_NUMBER.sub("", compact, count=1) if compact.startswith("N") else compact, comments, optional
    )


def _cut_comments(text: str, number: int, name: str) -> tuple[str, tuple[tuple[int, str], ...]]:
    """LinuxCNC's rule: `(` to the next `)`, and outside of that `;` to the end; comments become blanks."""
    words, comments = [], []
    start = 0
    for column, character in enumerate(text, 1):
        if start:
            if character == "(":
                raise InputError("a comment within a comment", expected="`)`", file=name, line=number, column=column)
            if character == ")":
                comments.append((start, text[start : column - 1]))
                start = 0
            words.append(" ")
        elif character == "(":
            start = column
            words.append(" ")
        elif character == ")":
            raise InputError("`)` without `(`", file=name, line=number, column=column)
        elif character == ";":
            comments.append((column, text[column:]))
            break
        else:
            words.append(character)
    if start:
        raise InputError(
            "a comment is not closed", expected="`)` on the same line", file=name, line=number, column=start
        )
    return "".join(words), tuple(comments)


def without_expressions(words: str) -> str:
    """Words with what stands in square brackets left out."""
    if "[" not in words:
        return words
    kept, depth = [], 0
    for character in words:
        depth += character == "["
        if not depth:
            kept.append(character)
        depth -= character == "]" and depth > 0
    return "".join(kept)


def needs_tags(lines: Iterable[Line]) -> bool:
    """Whether the copy must carry its line numbers as comments too, which stay in order with the moves."""
    return any("G" in line.words and NEEDS_TAGS.search(line.words) for line in lines)


def numbered(lines: Iterable[Line], name: str, *, block_delete: bool, tags: bool, prefix: tuple[str, ...] = ()) -> str:
    """The text for `rs274`: after the `prefix`, one line for each of the program's.

    Text before a tape mark that follows words, and after it, is treated as by the built-in reader: the second `%`, or
    one that follows words, ends the program. `M2` is added: LinuxCNC wants an end.
    """
    copy = list(prefix)
    started = False
    for line in lines:
        if line.words == "%":
            if started:
                break
            started = True
            copy.append("")
            continue
        started = started or bool(line.words)
        copy.append(_numbered_line(line, name, tags) if not (line.optional and block_delete) else "")
    return "\n".join([*copy, "M2", ""])


def _numbered_line(line: Line, name: str, tags: bool) -> str:
    aborts = any("".join(text.split()).lower().startswith(ABORT) for _, text in line.comments)
    if not line.words and not aborts:
        return ""
    comment = f"({ABORT}stopped by the program)" if aborts else f"({line.number})" if tags else ""
    if line.words.startswith("O") and not aborts:  # after an O word some forms take no comment
        comment = ""
    text = f"N{line.number}{line.words}{comment}"
    if len(text) > LONGEST_LINE:
        raise InputError(
            f"a line of {len(text)} characters without blanks and comments",
            expected=f"at most {LONGEST_LINE}, as LinuxCNC reads",
            file=name,
            line=line.number,
        )
    return text
