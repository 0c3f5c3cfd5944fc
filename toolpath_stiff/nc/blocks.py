"""The words of a block, sorted into codes and values; every word is taken by something, or it is an error."""

from __future__ import annotations

from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes import (
    G_GROUPS,
    G_HARMLESS,
    G_REFUSED,
    HOLDS_TIP,
    INCH_METRIC,
    M_GROUPS,
    M_HARMLESS,
    M_QUIET,
    M_REFUSED,
    ONCE,
    code_name,
)
from toolpath_stiff.nc.dialects import GENERIC, Dialect
from toolpath_stiff.nc.moves import Unsupported
from toolpath_stiff.nc.words import POLAR, Block, Word

AXES = "XYZABC"
POINT_WORDS = (*AXES, *POLAR)
FARTHEST_MM = 1e5  # 100 m: a coordinate beyond is a slip of unit or key


@dataclass
class Codes:
    """G and M codes of one block, by modal group, each with its word."""

    groups: dict[str, tuple[str, Word]] = field(default_factory=dict)
    once: list[tuple[str, Word]] = field(default_factory=list)

    def get(self, group: str) -> str | None:
        """The code of a group, if the block has one."""
        found = self.groups.get(group)
        return found[0] if found else None


class BlockReader:
    """The block in hand: its codes by modal group, its words until something takes them, and what is to be said."""

    def __init__(self, name: str, dialect: Dialect = GENERIC) -> None:
        self.name, self.dialect = name, dialect
        self.unsupported: list[Unsupported] = []
        self.warnings: list[str] = []
        self.assumptions: list[str] = []
        self.values: dict[str, Word] = {}
        self.free: set[str] = set()
        self.block = Block(0, ())
        self.bare: tuple[int, Word] | None = None  # the first length without a point, and its line
        self.pointed = False  # whether any length ends with its point, as `X10.`

    def fail(self, word: Word | None, found: str, expected: str = "", hint: str = "") -> InputError:
        """An error at a word of the block, or at the block."""
        text = f"{word.text} {found}" if word else found
        column = word.column if word else self.block.words[0].column
        return InputError(text, expected=expected, hint=hint, file=self.name, line=self.block.line, column=column)

    def _collect(self, block: Block) -> Codes:
        """Sort the words; repeated words and two codes of one group are errors."""
        codes = Codes()
        self.values = {}
        for word in block.words:
            if word.letter == "G":
                self._collect_g(codes, word)
            elif word.letter == "M":
                self._collect_m(codes, word)
            elif word.letter == "O":
                self._note(word, "program number")
            elif word.letter in self.values:
                raise self.fail(word, f"repeats the word {word.letter} of its block", "each word once")
            else:
                self.values[word.letter] = word
        self.free = set(self.values)
        for letter in ("U", "V", "W"):
            if letter in self.values:
                raise self.fail(self.values[letter], "moves an axis that this machine does not have", "X Y Z A B C")
        for letter in (*AXES, "@"):
            if letter in self.values and abs(self.values[letter].value) > FARTHEST_MM:
                raise self.fail(self.values[letter], "is beyond 100 m", f"at most {FARTHEST_MM:g}")
        return codes

    def _collect_g(self, codes: Codes, word: Word) -> None:
        code = code_name("G", word.value)
        if code == self.dialect.holds_tip:
            code = HOLDS_TIP
        if code in INCH_METRIC:
            if not self.dialect.inch_metric:
                raise self.fail(word, f"is {self.dialect.g70[0]}, which is not supported", hint=self.dialect.g70[1])
            code = INCH_METRIC[code]
        if code in G_REFUSED:
            what, hint = G_REFUSED[code]
            raise self.fail(word, f"is {what}, which is not supported", hint=hint)
        group = G_GROUPS.get(code)
        if group is None:
            raise self.fail(word, "is not a G code that is known", hint="check the program, or post it without it")
        if code in G_HARMLESS:
            self._note(word, G_HARMLESS[code])
        if group == ONCE:
            for other, _ in codes.once:  # LinuxCNC's modal group 0
                raise self.fail(word, f"and {other} both act once, in this block", "one of them in a block")
            codes.once.append((code, word))
            return
        if group in codes.groups:
            other = codes.groups[group][0]
            # `G0 G17 G40 G49 G80 G90`, the usual first block: G80 ends a cycle, the other code says what follows.
            if code == "G80" and other != "G80":
                return
            if other != "G80" or code == "G80":
                raise self.fail(word, f"and {other} are both of the modal group {group!r}", "one of them in a block")
        codes.groups[group] = (code, word)

    def _collect_m(self, codes: Codes, word: Word) -> None:
        code = code_name("M", word.value)
        if code in M_REFUSED:
            what, hint = M_REFUSED[code]
            raise self.fail(word, f"is {what}, which is not supported", hint=hint)
        group = M_GROUPS.get(code)
        if group is not None:
            key = f"M {group}"
            if key in codes.groups:
                other = codes.groups[key][0]
                raise self.fail(word, f"and {other} are both of the modal group {group!r}", "one of them in a block")
            codes.groups[key] = (code, word)
        if code not in M_QUIET:
            reason = M_HARMLESS.get(code, "an M code of one control, not acted upon")
            self._note(word, reason)
            if code not in M_HARMLESS:  # it may run anything, a change of kinematics included
                self.warnings.append(f"line {self.block.line}: what {word.text} does on its control is not known")
            if group is None:  # its parameters, whatever they are, go with it
                self._note_parameters(word)

    def _note_parameters(self, word: Word) -> None:
        """P, Q, E, R words of a block with an unknown M code belong to it."""
        for other in self.block.words:
            if other.letter in "PQE":
                self._note(other, f"parameter of {word.text}")

    def _note(self, word: Word, reason: str) -> None:
        self.unsupported.append(Unsupported(self.block.line, word.column, word.text, reason))

    def assume(self, sentence: str) -> None:
        """Note what is taken for granted, once."""
        if sentence not in self.assumptions:
            self.assumptions.append(sentence)

    def take(self, letter: str) -> float | None:
        """The value of a word, which is thereby used; None if the block has none."""
        if letter not in self.free:
            return None
        self.free.discard(letter)
        return self.values[letter].value

    def has(self, letter: str) -> bool:
        """Whether the block has that word, not used yet."""
        return letter in self.free
