"""Words A, B, C of a program on machines without all three axes."""

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.errors import InputError
from toolpath_stiff.units import deg_from_rad

LETTERS = ("A", "B", "C")


def refuse_words(machine: str, abc: FloatArray, axes: str) -> None:
    """Raise `InputError` if words A, B, C (n, 3) rad of an axis that is not among `axes` are not 0."""
    for letter, words in zip(LETTERS, abc.T, strict=True):
        if letter not in axes and words.any():
            turned = deg_from_rad(float(words[abs(words).argmax()]))
            mistake = f"machine {machine} has no axis {letter}, and the program turns it to {turned:g} deg"
            expected = f"no rotary words but {', '.join(axes)}" if axes else "a program without rotary words"
            raise InputError(mistake, expected=expected)
