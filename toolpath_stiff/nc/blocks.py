"""The block in hand: its codes by modal group, its words until something takes them, what it asks of the next one."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.words import AXES, POLAR, Block, Word

POINT_WORDS = (*AXES, *POLAR)
FARTHEST_MM = 1e5  # 100 m: a coordinate beyond is a slip of unit or key


class Flow(Enum):
    """Which block runs after this one, unless that is a `Call`."""

    NEXT = "the next one"
    RETURN = "the one after the call (M99)"
    END = "none: the program has ended"


@dataclass(frozen=True)
class Call:
    """A subprogram call: its P, its L (None: not given), the column of its M98; `local`: it is M97, P an N number."""

    number: int
    repeats: int | None
    column: int
    local: bool = False


@dataclass
class CurrentBlock:
    """The block that is executed.

    Attributes
    ----------
    name
        Of the program, for errors.
    block
        As it was read.
    codes
        Code -> its word, of the codes that are known.
    groups
        Modal group -> code; no two codes of a group are in one block.
    values
        Letter -> word, of the other words; `free` are the letters that nothing has taken yet.
    spoke
        Its polar words (@, ^): the first one, radius and angle.
    flow
        What it asks of whoever runs the blocks, once its own moves are made.
    """

    name: str
    block: Block
    codes: dict[str, Word] = field(default_factory=dict)
    groups: dict[str, str] = field(default_factory=dict)
    values: dict[str, Word] = field(default_factory=dict)
    free: set[str] = field(default_factory=set)
    spoke: tuple[Word, float | None, float | None] | None = None
    flow: Flow | Call = Flow.NEXT

    @property
    def line(self) -> int:
        """Its line, from 1."""
        return self.block.line

    def code(self, group: str) -> tuple[str, Word] | None:
        """The code of a modal group, and its word; None if the block has none."""
        name = self.groups.get(group)
        return None if name is None else (name, self.codes[name])

    def has(self, letter: str) -> bool:
        """Whether the block has that word, not used yet."""
        return letter in self.free

    def take(self, letter: str) -> float | None:
        """The value of a word, which is thereby used; None if the block has none."""
        if letter not in self.free:
            return None
        self.free.discard(letter)
        return self.values[letter].value

    def as_written(self, letter: str) -> Word:
        """A word with the number of its text, whatever the decimal-point rule made of it."""
        return next(word for word in self.block.words if word.letter == letter)

    def whole(self, letter: str, word: Word) -> int | None:
        """The count that a word beside a code gives, taken; None without it. Raises `InputError`."""
        value = self.take(letter)
        if value is None:
            return None
        if value != int(value) or value < 1:
            raise self.fail(self.values[letter], f"beside {word.text} is no count", "a whole number from 1")
        return int(value)

    def fail(self, word: Word | None, found: str, expected: str = "", hint: str = "") -> InputError:
        """An error at a word of the block, or at the block."""
        text = f"{word.text} {found}" if word else found
        column = word.column if word else self.block.words[0].column
        return InputError(text, expected=expected, hint=hint, file=self.name, line=self.line, column=column)
