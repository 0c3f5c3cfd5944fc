"""A line of a file, for error messages."""

from typing import NamedTuple

from toolpath_stiff.errors import ProgramError


class Place(NamedTuple):
    """A line (from 1) of a file, and the column in it if known."""

    name: str
    line: int
    column: int | None = None

    def fail(self, problem: str, expected: str = "", hint: str = "", column: int | None = None) -> ProgramError:
        """An error at this line, and at the place's own column unless another is given."""
        where = self.column if column is None else column
        return ProgramError(problem, expected=expected, hint=hint, file=self.name, line=self.line, column=where)
