"""Errors that a user can act on: where the problem is, what was found, what was expected, what to do.

A tree, so that a caller can catch as much as it can handle::

    TpsError
      InputError            something in the input is wrong
        ProgramError        an NC program, or what belongs to its control
        MeasurementError    readings, raw records, plans
        EffectError         a physical effect, or its parameters
        UnreachableError    a pose beyond the machine's limits
      InputErrors           several input errors together
      EffectFault           a user's own effect breaks the contract

>>> from toolpath_stiff.machine.file import load_machine
>>> try:
...     load_machine("nits")
... except InputError as error:
...     print(error.found)
machine 'nits' is neither a packaged machine nor a file
"""

from __future__ import annotations

from collections.abc import Iterable

# Characters that steer a terminal or reverse the order of letters: all control characters but tab and line feed, and
# Unicode's bidirectional ones (standard annex 9); halves of surrogate pairs, which no encoding has.
STEERING = (*range(9), *range(11, 32), *range(127, 160), 0x61C, 0x200E, 0x200F, *range(0x202A, 0x202F),
            *range(0x2066, 0x206A), *range(0xD800, 0xE000))  # fmt: skip
_HARMLESS = dict.fromkeys(STEERING, "?")


def harmless(text: str) -> str:
    """Text that is safe to print on a terminal."""
    return text.translate(_HARMLESS)


LONGEST_QUOTE = 2000  # characters of what was found: a line, a number or a name may have a million
MOST_TOLD = 20  # of several errors


class TpsError(Exception):
    """Base of every error that the command line turns into one message and an exit code (2).

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> try:
    ...     tps.pose((0, 0, 5000), "nist")
    ... except tps.TpsError as error:
    ...     print(type(error).__name__, error.exit_code)
    UnreachableError 2
    """

    exit_code = 2


class InputError(TpsError):
    """Something in the user's input is wrong.

    The message reads ``file:line:column: found ...; expected ...`` with only the parts that apply, and
    ends with what to do, if that is not obvious.

    Parameters
    ----------
    found
        What is wrong, quoting the input.
    expected
        What would have been right.
    hint
        What to do next, an imperative sentence.
    file, line, column
        Where; line and column count from 1. For tables `line` is the line of the file; say "row" in `found`.

    Examples
    --------
    >>> print(InputError("step 0 mm", expected="more than 0", hint="say how far", file="a.csv", line=3))
    a.csv:3: step 0 mm; expected more than 0. Say how far
    """

    def __init__(
        self,
        found: str,
        *,
        expected: str = "",
        hint: str = "",
        file: str | None = None,
        line: int | None = None,
        column: int | None = None,
    ) -> None:
        half = LONGEST_QUOTE // 2
        self.found = found if len(found) <= LONGEST_QUOTE else f"{found[:half]} ... {found[-half:]}"
        self.expected, self.hint = expected, hint
        self.file, self.line, self.column = file, line, column
        where = "".join(f"{part}:" for part in (file, line, column) if part is not None)
        text = f"{where} {self.found}".strip() + (f"; expected {expected}" if expected else "")
        super().__init__(f"{text}. {hint[0].upper()}{hint[1:]}" if hint else text)

    def in_line(self, file: str, line: int) -> InputError:
        """The same error, located at a line of a file.

        Examples
        --------
        >>> print(InputError("no number").in_line("a.csv", 3))
        a.csv:3: no number
        """
        return type(self)(self.found, expected=self.expected, hint=self.hint, file=file, line=line)


class InputErrors(TpsError):
    """Several input errors, reported together (bad rows of a table, say).

    Examples
    --------
    >>> print(InputErrors([InputError("no number", line=2), InputError("no unit", line=5)]))
    2: no number
    5: no unit
    """

    def __init__(self, errors: Iterable[InputError]) -> None:
        self.errors = tuple(errors)
        further = len(self.errors) - MOST_TOLD
        last = [f"and {further} further errors"] if further > 0 else []
        super().__init__("\n".join([*map(str, self.errors[:MOST_TOLD]), *last]))


class ProgramError(InputError):
    r"""An NC program, a controller file, a tool table or offsets cannot be read, or cannot be used as asked.

    Raised by `analyze`, `check`, `place`, `rewrite` and the like; `line` and `column` say where to mend it.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> try:
    ...     tps.sample_path(tps.Program.from_text("G21\nG1 X40 F", name="slot.nc"))
    ... except tps.ProgramError as error:
    ...     print(error.line, error.column, error.found)
    2 8 the word 'F' has no number
    """


class MeasurementError(InputError):
    r"""Readings, raw records or a plan lack what is needed, or contradict themselves; `line` says which row.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = pathlib.Path(folder, "measured.csv")
    ...     _ = file.write_text("x_mm,y_mm,z_mm\n0,0,800\n")
    ...     try:
    ...         tps.Measurements.read(file)
    ...     except tps.MeasurementError as error:
    ...         print(error.line, error.found)
    1 column direction is missing (found x_mm, y_mm, z_mm)
    """


class EffectError(InputError):
    """A physical effect does not exist, is declared wrongly, or has parameters that are not possible.

    A fit takes it for values to walk away from; otherwise mend the entry in the machine file or the effect's file.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> try:
    ...     tps.preview("nist-table1", "nist").at({"weak_strut": {"strut": 7, "factor": 0.8}})
    ... except tps.EffectError as error:
    ...     print(error)
    by hand: effect weak_strut: strut = 7; expected a whole number from 1 to 6
    """


class UnreachableError(InputError):
    """A pose that the machine cannot take: a limit exceeded, or a singular configuration.

    Move the work (`origin`), widen the search, or keep the reachable part.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> try:
    ...     tps.pose((0, 0, 5000), "nist")
    ... except tps.UnreachableError as error:
    ...     print(error.found)
    the pose is out of reach on machine nist: frame joint2 angle needs 97.97 deg, limit 30.00 deg, 67.97 deg beyond
    """


class EffectFault(TpsError):
    """A user's own effect does not do what the contract asks: where, what it did, what was expected.

    Not an `InputError`: fits take those for values to walk away from, and a fault must end them. Keywords as there.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> error = tps.EffectFault("strut_compliance gives (6,)", expected="(n, 6)", file="my_screw.py", line=31)
    >>> print(error)
    my_screw.py:31: strut_compliance gives (6,); expected (n, 6)
    """

    def __init__(
        self, found: str, *, expected: str = "", hint: str = "", file: str | None = None, line: int | None = None
    ) -> None:
        self.found, self.file, self.line = found, file, line
        super().__init__(str(InputError(found, expected=expected, hint=hint, file=file, line=line)))
