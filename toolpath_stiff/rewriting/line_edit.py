"""Edits of one line of a program: words replaced, added, taken out; everything else stays as it stands."""

from __future__ import annotations

from collections.abc import Iterable

from toolpath_stiff.nc.words import AXES, Block, Word

SAME = 1e-9  # mm, inch or degrees: a word whose number changes by less keeps its text
FEED_DECIMALS = 6
# Added words go behind the last word present of those that come before them here.
ORDER = ("G", "X", "Y", "Z", "A", "B", "C", "I", "J", "K", "R", "Q", "P", "L", "F")
NUMBERS = frozenset("XYZABCIJKR")


class LineEdit:
    """A line, cut into its words and what stands between them (blanks, comments, the N word).

    Parameters
    ----------
    text, block
        The line without its end, and the words read from it.
    decimals
        Of the numbers written.
    """

    def __init__(self, text: str, block: Block, decimals: int) -> None:
        self.block, self.decimals = block, decimals
        self._words = list(block.words)
        self._texts = [word.text for word in block.words]
        ends = [0, *(word.column - 1 + len(word.text) for word in block.words)]
        starts = [*(word.column - 1 for word in block.words), len(text)]
        self._gaps = [text[end:start] for end, start in zip(ends, starts, strict=True)]
        packed = len(self._gaps) > 2 and "" in self._gaps[1:-1]
        self._between = "" if packed else " "
        self._points = any("." in word.text for word in block.words if word.letter in NUMBERS)
        self._lower = bool(block.words) and block.words[0].text[0].islower()

    def word(self, letter: str) -> Word | None:
        """The block's word of a letter other than G and M; None if it has none."""
        return next((word for word in self._words if word.letter == letter), None)

    def write(self, letter: str, value: float, decimals: int | None = None) -> None:
        """Give a word another number, or add the word."""
        word = self.word(letter)
        text = self._number(value, self.decimals if decimals is None else decimals)
        if word is None:
            self._add(letter, (letter.lower() if self._lower else letter) + text)
        elif abs(value - word.value) > SAME:
            self.replace(word, word.text[0] + text)

    def replace(self, word: Word, text: str) -> None:
        """Put other text in a word's place."""
        self._texts[self._words.index(word)] = text

    def add_code(self, code: str) -> None:
        """Add a G code, `G1` say, before the other words."""
        self._add("G", code.lower() if self._lower else code)

    def remove(self, letters: Iterable[str]) -> None:
        """Take out the words of these letters."""
        for letter in letters:
            word = self.word(letter)
            if word is not None:
                self.cut(word)

    def cut(self, word: Word) -> None:
        """Take out a word, and the blanks beside it that are then one too many."""
        at = self._words.index(word)
        del self._words[at], self._texts[at]
        before, after = self._gaps[at], self._gaps.pop(at + 1)
        if not before.strip() and at > 0:
            self._gaps[at] = after
        elif not after.strip():
            self._gaps[at] = before
        else:
            self._gaps[at] = before + after

    def render(self) -> str:
        """The line as edited."""
        return "".join(gap + text for gap, text in zip(self._gaps, [*self._texts, ""], strict=True))

    def next_line(self, lead: str) -> LineEdit:
        """A further line in this one's style, with no words yet; `lead` stands before them."""
        line = LineEdit(lead, Block(self.block.line, ()), self.decimals)
        line._between, line._points, line._lower = self._between, self._points, self._lower
        return line

    @property
    def moves(self) -> bool:
        """Whether the line holds an axis word."""
        return any(word.letter in AXES for word in self._words)

    def _add(self, letter: str, text: str) -> None:
        rank = ORDER.index(letter)
        added = Word(letter, 0.0, 0, text)
        ranked = [(ORDER.index(w.letter), i) for i, w in enumerate(self._words) if w.letter in NUMBERS]
        before, after = [i for r, i in ranked if r < rank], [i for r, i in ranked if r > rank]
        codes = [i for i, w in enumerate(self._words) if w.letter == "G"]
        if letter == "G":
            at = 0
        elif before:
            at = before[-1] + 1
        elif after:
            at = after[0]
        else:
            at = codes[-1] + 1 if codes else len(self._words)
        self._words.insert(at, added)
        self._texts.insert(at, text)
        if at == 0:  # what stands before the first word stays there
            self._gaps.insert(1, self._between if len(self._words) > 1 else "")
        else:
            self._gaps.insert(at, self._between)

    def _number(self, value: float, decimals: int) -> str:
        """Fixed digits without idle zeros; a whole number keeps its point where the block writes points.

        A control that counts `X9` in its least increment reads `X9.` right, so the block's own style is kept.
        """
        text = f"{value:.{decimals}f}"
        text = text.rstrip("0") if "." in text else text
        if not text.strip("-0."):
            text = "0."
        return text if self._points else text.removesuffix(".")
