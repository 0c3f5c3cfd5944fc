"""Which block runs next: subprogram calls (M97, M98), M99, the end (M2, M30). `subprograms` acts upon it."""

from __future__ import annotations

from toolpath_stiff.nc.blocks import Call, CurrentBlock, Flow
from toolpath_stiff.nc.codes.contract import M_STOP, M_SUBPROGRAM, ONCE, Code, holds_anyway, m_codes
from toolpath_stiff.nc.state import State


def call(state: State, block: CurrentBlock, code: str) -> None:
    """M98 P L: run a subprogram; M97 P L (Haas): run from the block with that N number. After the block's own moves."""
    word = block.codes[code]
    if code == "M97" and not state.dialect.local_calls:
        raise block.fail(
            word,
            "is Haas' call of a block by its N number",
            hint="give --dialect haas if it is that, or make it a subprogram (O number, M98, M99)",
        )
    if block.groups.get(ONCE) in ("G4", "G10"):
        raise block.fail(word, "beside a code that wants the P word too", "two blocks")
    number, repeats = block.whole("P", word), block.whole("L", word)
    if number is None:
        raise block.fail(word, "without P", "P with the number of what it calls")
    block.flow = Call(number, repeats, word.column, local=code == "M97")


def end_of_subprogram(state: State, block: CurrentBlock, code: str) -> None:
    """M99: back to the block after the call."""
    if block.has("P"):
        raise block.fail(block.values["P"], "makes M99 return to another block, which is not supported", "M99")
    block.flow = Flow.RETURN


def end_of_program(state: State, block: CurrentBlock, code: str) -> None:
    """M2, M30: nothing runs after this block."""
    block.flow = Flow.END


_CALLS = "LinuxCNC, O Codes, Fanuc-Style Programs; Fanuc, operator's manuals, Subprogram (M98, M99)"
CODES = (
    Code("M0", M_STOP, holds_anyway, "stop", m_codes("M0 M1")),
    Code("M1", M_STOP, holds_anyway, "optional stop", m_codes("M0 M1")),
    Code("M60", M_STOP, holds_anyway, "stop", m_codes("M60")),
    Code("M2", M_STOP, end_of_program, "end", m_codes("M2 M30")),
    Code("M30", M_STOP, end_of_program, "end", m_codes("M2 M30")),
    Code(
        "M97", M_SUBPROGRAM, call, "call by line number (Haas)", "Haas, mill operator's manual, M97",
        controls=("haas",),
    ),
    Code("M98", M_SUBPROGRAM, call, "subprogram call", _CALLS),
    Code("M99", M_SUBPROGRAM, end_of_subprogram, "subprogram end", _CALLS),
)  # fmt: skip
