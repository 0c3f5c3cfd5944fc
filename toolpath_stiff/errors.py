"""Errors that a user can act on: where it is, what was found, what was expected, what to do."""

from __future__ import annotations

from collections.abc import Iterable


class TpsError(Exception):
    """Base of every error that the command line turns into one message and an exit code (2)."""

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
        self.found, self.expected, self.hint = found, expected, hint
        self.file, self.line, self.column = file, line, column
        super().__init__(self._message())

    def _message(self) -> str:
        where = [str(part) for part in (self.file, self.line, self.column) if part is not None]
        text = f"{':'.join(where)}: {self.found}" if where else self.found
        if self.expected:
            text += f"; expected {self.expected}"
        if self.hint:
            text += f". {self.hint[0].upper()}{self.hint[1:]}"
        return text


class InputErrors(TpsError):
    """Several input errors, reported together (bad rows of a table, say)."""

    def __init__(self, errors: Iterable[InputError]) -> None:
        self.errors = tuple(errors)
        super().__init__("\n".join(str(error) for error in self.errors))


class UnreachableError(InputError):
    """A pose that the machine cannot take: a limit exceeded, or a singular configuration."""


class EffectFault(TpsError):
    """A user's own effect does not do what the contract asks: where, what it did, what was expected.

    Not an `InputError`: fits take those for values to walk away from, and a fault must end them. Keywords as there.
    """

    def __init__(
        self, found: str, *, expected: str = "", hint: str = "", file: str | None = None, line: int | None = None
    ) -> None:
        self.found, self.file, self.line = found, file, line
        super().__init__(str(InputError(found, expected=expected, hint=hint, file=file, line=line)))
