"""What a check says of a program: codes, errors, warnings, notes, and where each stands."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.moves import ReadProgram
from toolpath_stiff.nc.state import START

ERROR, WARNING, NOTE = "error", "warning", "note"


@dataclass(frozen=True)
class Finding:
    """One finding about a program.

    Attributes
    ----------
    line, column
        Where, from 1; 0: of the program as a whole.
    code
        What kind of finding it is, a short word; of used and unsupported words the word itself.
    text
        One sentence.
    severity
        "error": the program is refused for it; "warning": to be checked; "note": for the record.
    """

    line: int
    column: int
    code: str
    text: str
    severity: str


@dataclass(frozen=True)
class UsedCode(Finding):
    """A G or M code of the program: where it stands first, how often, and what it is taken for."""

    count: int


@dataclass(frozen=True)
class Checked:
    """What was found without a machine.

    Attributes
    ----------
    program
        What was read; after an error the moves of the blocks that could be read.
    complete
        Whether the whole program was read.
    used
        Codes in the order of their first appearance.
    findings
        In the order of lines.
    start, end
        Modal state before the first block and after the last one, names to words.
    """

    program: ReadProgram
    complete: bool
    used: tuple[UsedCode, ...]
    findings: tuple[Finding, ...]
    start: dict[str, str] = field(default_factory=dict)
    end: dict[str, str] = field(default_factory=dict)

    @property
    def unsupported(self) -> tuple[Finding, ...]:
        """Words that were read and not acted upon."""
        return tuple(Finding(word.line, word.column, word.word, word.reason, NOTE) for word in self.program.unsupported)


def findings_of(errors: Iterable[InputError], program: ReadProgram) -> tuple[Finding, ...]:
    """All findings about a program, in the order of lines."""
    return in_order(
        [
            *(finding_of(error) for error in errors),
            *(Finding(remark.line, 0, "warning", remark.text, WARNING) for remark in program.warnings),
            *(Finding(0, 0, "assumption", text, NOTE) for text in program.assumptions if text != START),
        ]
    )


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings in the order of lines."""
    return tuple(sorted(findings, key=lambda finding: (finding.line, finding.column)))


def finding_of(error: InputError) -> Finding:
    """What could not be read."""
    text = error.found + (f"; expected {error.expected}" if error.expected else "")
    text += f". {error.hint[0].upper()}{error.hint[1:]}" if error.hint else ""
    return Finding(error.line or 0, error.column or 0, "not read", text, ERROR)
