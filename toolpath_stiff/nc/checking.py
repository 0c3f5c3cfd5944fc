"""Check of a program: codes used, and findings of the reader, which goes on where `read_program` would stop.

With `--interpreter linuxcnc`, what LinuxCNC's interpreter says of the program, in the words of the built-in check.
"""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from toolpath_stiff.errors import InputError
from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.codes.registry import code_meaning
from toolpath_stiff.nc.languages import foreign_program, refused_program
from toolpath_stiff.nc.linuxcnc.inputs import split
from toolpath_stiff.nc.moves import ReadProgram, Recorder, Remark
from toolpath_stiff.nc.parametric.families import line_with_variables
from toolpath_stiff.nc.program_run import ProgramRun
from toolpath_stiff.nc.reader import (
    PARAMETRIC,
    READ_ELSEWHERE,
    in_language,
    no_cut,
    on_the_part,
    read,
    recognised,
    run_of,
)
from toolpath_stiff.nc.request import Request
from toolpath_stiff.nc.run_records import Tally
from toolpath_stiff.nc.state import START, Record

CODE = re.compile(r"([GM])(\d+\.?\d*)")
ERROR, WARNING, NOTE = "error", "warning", "note"
NEEDED = re.compile(r"--(?:dialect|controller|offsets|tools|subprograms|feed|interpreter)\b")


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
    """A G or M code of the program: its first place, its count, and its meaning to the reader."""

    count: int


@dataclass(frozen=True)
class Checked:
    """Findings about a program without a machine.

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
    language
        What the program is written in, and the sign by which that is recognised.
    """

    program: ReadProgram
    complete: bool
    used: tuple[UsedCode, ...]
    findings: tuple[Finding, ...]
    language: str = ""

    @property
    def needs(self) -> tuple[str, ...]:
        """Options without which the program is refused, each with the first line that needs it."""
        needed = dict[str, int]()
        for finding in self.findings:
            for option in NEEDED.findall(finding.text) if finding.severity == ERROR else ():
                needed.setdefault(option, finding.line)
        return tuple(f"{option} (line {line})" if line else option for option, line in needed.items())

    @property
    def unsupported(self) -> tuple[Finding, ...]:
        """Words that were read and not acted upon."""
        return tuple(Finding(word.line, word.column, word.word, word.reason, NOTE) for word in self.program.unsupported)


def findings_of(errors: Iterable[InputError], program: ReadProgram) -> tuple[Finding, ...]:
    """Findings about a program, in order of lines."""
    return in_order(
        [
            *(finding_of(error) for error in errors),
            *(Finding(remark.line, 0, "warning", remark.text, WARNING) for remark in program.warnings),
            *(Finding(0, 0, "assumption", text, NOTE) for text in program.assumptions if text != START),
        ]
    )


def in_order(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Findings in order of lines."""
    return tuple(sorted(findings, key=lambda finding: (finding.line, finding.column)))


def finding_of(error: InputError) -> Finding:
    """Finding on something that could not be read."""
    text = error.found + (f"; expected {error.expected}" if error.expected else "")
    text += f". {error.hint[0].upper()}{error.hint[1:]}" if error.hint else ""
    return Finding(error.line or 0, error.column or 0, "not read", text, ERROR)


def check(request: Request) -> Checked:
    """Check a program with the requested interpreter.

    "auto" is the built-in check where that reads the whole program, or LinuxCNC's interpreter cannot. Raises
    `InputError` for an empty program, or where "linuxcnc" is asked for and cannot be had.

    Examples
    --------
    >>> checked = check(Request(("G21 G90 F600", "G1 X10", "G41 D1", "M30"), "slot.nc"))
    >>> checked.complete, checked.program.interpreter
    (False, 'builtin')
    >>> [(code.code, code.text) for code in checked.used][-2:]
    [('G41', 'cutter compensation, tool on the left'), ('M30', 'end')]
    >>> checked.findings[0].line, checked.findings[0].severity
    (3, 'error')
    """
    language, sign = recognised(request)
    return replace(_checked(request, language), language=f"{language} ({sign})")


def _checked(request: Request, language: str) -> Checked:
    if request.interpreter == "linuxcnc":
        return _check_by_linuxcnc(request)
    if language in READ_ELSEWHERE:
        request = in_language(request, language)
        return _check_built_in(request, run_of(language)(request, Tally()))
    ours = _check_built_in(request, ProgramRun(request, Tally()))
    if request.interpreter == "builtin" or ours.complete or not request.controller.plain:
        return ours
    theirs = _check_by_linuxcnc(replace(request, interpreter="linuxcnc"), may_lack=True)
    why = next(finding for finding in ours.findings if finding.severity == ERROR)
    if not theirs.complete:
        refused = theirs.findings[0]
        other = replace(refused, code="not read", text=f"nor by LinuxCNC: {refused.text}")
        return replace(ours, findings=in_order([*ours.findings, other]))
    text = f"the built-in interpreter says: {why.text.partition('; ')[0]}"
    note = Finding(why.line, why.column, "interpreter", text, NOTE)
    return replace(theirs, findings=in_order([*theirs.findings, note]))


def _check_built_in(request: Request, run: ProgramRun) -> Checked:
    g_code = type(run) is ProgramRun
    errors, ending = _run_to_the_end(run, g_code)
    if errors and g_code and line_with_variables(request.lines):  # once more with their values, from the start
        run = run_of(PARAMETRIC)(request, Tally())
        errors, ending = _run_to_the_end(run, g_code)
    state, tally = run.state, run.tally
    assert tally is not None
    program = run.program(ending)
    try:
        program = on_the_part(program, request, state) if len(program.moves) else program
    except InputError as error:
        errors = [*errors, error]
        kinematics = request.controller.kinematics
        program = replace(program, moves=Recorder().moves(), kinematics=kinematics.label if kinematics else "")
    return Checked(program, not errors, _used_codes(tally, run.meaning), findings_of(errors, program))


def _run_to_the_end(run: ProgramRun, g_code: bool) -> tuple[list[InputError], list[Remark]]:
    """Run a program; returns its errors, and the warnings at its end. A file in another language has that one error."""
    assert run.tally is not None
    lines, name, errors, warnings = run.lines, run.name, run.tally.errors, list[Remark]()
    foreign = refused_program(lines, name, run.state.dialect) if g_code else None
    if foreign is None:
        try:
            warnings = run.run()
        except InputError as error:
            if str(error) not in map(str, errors):
                errors.append(error)
        suspects = errors if g_code else ()
        foreign = next((f for e in suspects if (f := foreign_program(lines, name, e.line)) is not None), None)
    if foreign is not None:
        return [foreign], warnings
    if not errors and not run.state.recorder.cuts:
        errors = [no_cut(run)]
    return errors, warnings


def _used_codes(tally: Tally, meaning: Callable[[str], str] = code_meaning) -> tuple[UsedCode, ...]:
    return tuple(UsedCode(*tally.first[code], code, meaning(code), NOTE, tally.count[code]) for code in tally.first)


def _check_by_linuxcnc(request: Request, may_lack: bool = False) -> Checked:
    """Check by LinuxCNC's interpreter, which must be installed unless it `may_lack`; codes as written, not as run."""
    try:
        program, errors = read(request), list[InputError]()
    except InputError as error:
        if error.file is None and not may_lack:
            raise
        errors = [error]
        origin = request.default_origin if request.origin is None else request.origin
        program = request.program(
            Record(request.name), origin=origin, interpreter="linuxcnc", dialect=request.controller.label
        )
    return Checked(program, not errors, _codes_in_lines(request), findings_of(errors, program))


def _codes_in_lines(request: Request) -> tuple[UsedCode, ...]:
    """G and M codes as written in the lines, not as often as they run; computed ones are not included."""
    tally = Tally()
    try:
        lines = split(request.lines, request.name)
    except InputError:
        return ()
    for line in lines:
        for letter, digits in CODE.findall(line.plain):
            tally.add(code_name(letter, float(digits)), line.number, 0)
    return _used_codes(tally)
