"""Words of a macro call (G65, G66) as local variables of the called program.

Fanuc's operator's manuals, "Custom macro" ("Macro call", "Argument specification" I and II).
"""

from collections.abc import Callable, Iterable

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.state import Call
from toolpath_stiff.nc.words import Word

ARGUMENTS = {
    "A": 1, "B": 2, "C": 3, "D": 7, "E": 8, "F": 9, "H": 11, "I": 4, "J": 5, "K": 6, "M": 13, "Q": 17, "R": 18, "S": 19,
    "T": 20, "U": 21, "V": 22, "W": 23, "X": 24, "Y": 25, "Z": 26,
}  # fmt: skip
SECOND_KIND = {"A": 1, "B": 2, "C": 3}  # then I, J, K up to ten times, from #4
LAST_LOCAL = 33
WHOLE_ARGUMENTS = frozenset("DHMST")  # numbers of tools, offsets and speeds, which have no decimal point
MACRO_CALLS = ("G65", "G66", "G67")
LARGEST_NUMBER = 99_999_999  # of a program, or of repeats
Fault = Callable[[Word, str, str], InputError]  # makes the error of a word: what is wrong with it, what was expected


def call_of(code: Word, words: Iterable[Word], modal: bool, increments: bool, fault: Fault) -> Call:
    """Call made by G65 or G66 and the words after it; `increments`: numbers without a point count increments."""
    given = {word.letter: word for word in words if word.letter in "PL"}
    if "P" not in given:
        raise fault(code, "without P", "P with the number of the macro")
    program, repeats = (_count(given[letter], fault) if letter in given else 1 for letter in "PL")
    return Call(program, repeats, code.column, arguments=arguments_of(words, increments, fault), modal=modal)


def _count(word: Word, fault: Fault) -> int:
    if word.value != round(word.value) or not 1 <= word.value <= LARGEST_NUMBER:
        raise fault(word, "is not a count", "a whole number from 1")
    return int(word.value)


def arguments_of(words: Iterable[Word], increments: bool, fault: Fault) -> dict[int, float | None]:
    """Local variables that the words of a macro call set."""
    words = [word for word in words if word.letter not in "PL"]
    second = any(sum(word.letter == letter for word in words) > 1 for letter in "IJK")
    arguments: dict[int, float | None] = {}
    triple, previous = -1, "K"
    for word in words:
        if second and word.letter in "IJK":
            triple += word.letter <= previous
            previous = word.letter
            place = 4 + 3 * triple + "IJK".index(word.letter)
        else:
            place = (SECOND_KIND if second else ARGUMENTS).get(word.letter, 0)
        if not 1 <= place <= LAST_LOCAL or place in arguments:
            expected = "each letter once; with I, J, K repeated no other ones than A, B, C"
            raise fault(word, "cannot be an argument of this call", expected)
        if increments and word.value and "." not in word.text and word.letter not in WHOLE_ARGUMENTS:
            raise fault(word, "has no decimal point, and parameters of the control scale it", f"{word.text}.")
        arguments[place] = word.value
    return arguments
