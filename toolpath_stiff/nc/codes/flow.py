"""Program flow: subprogram calls (M97, M98, G65), M99, stops and the end; `program_run` carries them out."""

from toolpath_stiff.nc.codes.code import FANUC, Code, family, holds_anyway, m_codes
from toolpath_stiff.nc.state import Call, CurrentBlock, Flow, State


def call(state: State, block: CurrentBlock, code: str) -> None:
    """M98 P L: run a subprogram; M97 P L (Haas): from that N number. The block's moves first."""
    word = block.codes[code]
    block.refuse_if(block.groups.get("non-modal") in ("G4", "G10"), word, "beside another code with P", "two blocks")
    block.refuse_if(block.has("Q"), "Q", f"beside {word.text} names a block", "a subprogram of its own (O, M99)")
    number = block.whole("P", word)
    if number is None:
        raise block.fail(word, "without P", "P with the number of what it calls")
    if state.dialect.name == "linuxcnc" and "L" in block.values and block.values["L"].value == 0:
        block.take("L")  # LinuxCNC's tests/interp/m98m99: L0 calls nothing
    else:
        block.flow = Call(number, block.whole("L", word), word.column, code == "M97")


def macro_call(state: State, block: CurrentBlock, code: str) -> None:
    """G65, G66, G67: refused here, on a control without macro calls; elsewhere `parametric` carries them out."""
    raise block.fail(code, "is a macro call of Fanuc's and Haas' controls", hint="name the control with --dialect")


def end_of_subprogram(state: State, block: CurrentBlock, code: str) -> None:
    """M99: back to the block after the call; with P, to the block of the caller with that N number."""
    number = block.whole("P", block.codes[code])
    block.flow = Flow.RETURN if number is None else block.values["P"]


def end_of_program(state: State, block: CurrentBlock, code: str) -> None:
    """M2, M30: nothing runs after this block."""
    block.flow = Flow.END


_CALLS = "LinuxCNC, O Codes, Fanuc-Style Programs; Fanuc, operator's manuals, Subprogram (M98, M99)"
_MACROS = {"G65": "macro call", "G66": "macro call after moves", "G67": "no such call"}
_MACRO_SOURCE = f"{FANUC}, Custom macro, Macro call (G65, G66, G67)"
FLOW_CODES = (
    *family({"M0": "stop", "M1": "optional stop"}, "M stop", holds_anyway, m_codes("M0 M1")),
    Code("M60", "M stop", holds_anyway, "stop", m_codes("M60")),
    *family({"M2": "end", "M30": "end"}, "M stop", end_of_program, m_codes("M2 M30")),
    Code("M97", "M subprogram", call, "call by line number (Haas)", "Haas, mill operator's manual, M97", ("haas",)),
    Code("M98", "M subprogram", call, "subprogram call", _CALLS),
    *family(_MACROS, "non-modal", macro_call, _MACRO_SOURCE, ("generic", "fanuc", "haas")),
    Code("M99", "M subprogram", end_of_subprogram, "subprogram end", _CALLS),
)
