"""A block in Siemens' language: words sorted, then codes in their order, then the move, then the cycles."""

from collections.abc import Iterable

from toolpath_stiff.nc.codes.code import code_name
from toolpath_stiff.nc.contouring.drawing import drawing, elements_of
from toolpath_stiff.nc.elements import Element
from toolpath_stiff.nc.interpreter import execute_straight
from toolpath_stiff.nc.run_records import Tally
from toolpath_stiff.nc.siemens.cycles import repeated
from toolpath_stiff.nc.siemens.motion import move, moves, round_all
from toolpath_stiff.nc.siemens.vocabulary import REFUSED, TABLE, WORDS
from toolpath_stiff.nc.state import STEPS, CurrentBlock, Flow, State
from toolpath_stiff.nc.words import Block

SINGLE = ("motion", "distance", "plane", "cutter compensation", "work offset", "units", "feed mode")
BETWEEN = frozenset((*SINGLE[:2], "F", "S", "look-ahead", "M coolant", "M stop"))  # the moves of a corner
SETS = frozenset(("F", "S", "G0", "G1"))
OTHER_NUMBERS = {"G4", "G25", "G26"}  # beside these, F and S are no feed and no speed


def straight(state: State, block: Block) -> bool:
    """Execute a plain block of G0 or G1 that no CT follows; False, with nothing done, for any other one."""
    plain, turns = state.plain, any(word.letter in "ABC" for word in block.words)
    if plain.modal or plain.renumbered or turns or not execute_straight(state, block):
        return False
    plain.heading = None
    return True


def sort_words(state: State, block: Block, tally: Tally | None) -> CurrentBlock:
    """The words of a block by kind; in a check they are counted. Raises `InputError` at a word."""
    current = CurrentBlock(state.name, block)
    numbers = {code_name("G", word.value) for word in block.words if word.letter == "G"}
    acting = {"#": "T", '"': "T", "D": "D"} | ({} if numbers & OTHER_NUMBERS else {"F": "F", "S": "S"})
    for word in block.words:
        coded, letter = word.letter in ("G", "M"), word.letter
        name = code_name(letter, word.value) if coded else acting.get(letter, letter)
        if name in REFUSED:
            raise current.fail(word, f"is {REFUSED[name].what}, which is not supported", hint=REFUSED[name].hint)
        code = TABLE.get(name) if coded or letter in acting or len(name) > 1 else None
        if code is None and coded:
            current.refuse_if(letter == "G", word, "is not a G code that is known", hint="post it without it")
            state.note_unknown(block.line, word)
        if code is not None:
            other = current.groups.setdefault(code.group, name)
            current.refuse_if(other != name and code.group in SINGLE, word, f"and {other} act alike", "one of them")
            current.codes[name] = word
            if code.listed:
                state.note(block.line, word, code.listed)
            if tally is not None and not coded and letter not in acting:
                tally.add(name, block.line, word.column)
        if not coded and (code is None or letter in acting):
            current.add(letter, word)
    current.free -= current.free if numbers & {"G25", "G26"} else set()
    return current


def carry_out(state: State, block: CurrentBlock) -> None:
    """Carry out the codes of a block in their order, its move, the cycle of MCALL, then its own cycle."""
    plain, frames = state.plain, state.frames
    codes = sorted((TABLE[name] for name in block.codes), key=lambda code: code.rank)
    waits = plain.held is not None and any(code.group not in BETWEEN for code in codes)
    block.refuse_if(waits, None, "stands between a corner (RND, CHF, CHR) and the move behind it", "the move")
    before = frames.to_program(frames.position)
    for code in codes:
        if code.rank <= STEPS["motion"]:
            code.act(state, block, code.name)
    now = frames.to_program(frames.position)
    plain.renumbered |= {axis for axis in range(6) if abs(now[axis] - before[axis]) > 1e-9}
    round_all(state, block)
    if moves(state, block):
        move(state, block)
        repeated(state, block)
    elif state.motion in ("G0", "G1") and SETS & block.codes.keys() and "MCALL" not in block.codes:
        repeated(state, block)  # in blocks without a move, too
    for code in codes:
        if code.rank > STEPS["motion"]:
            code.act(state, block, code.name)
    for letter in sorted(block.free):
        block.refuse_if(
            letter not in WORDS,
            letter,
            "is not used by any code of its block",
            hint="remove it, or give a call its own block",
        )
        state.note(block.line, block.values[letter], "how the control moves: the path is taken as programmed")


def draw(state: State, block: CurrentBlock, blocks: Iterable[Block]) -> list[Element]:
    """Contour elements that blocks draw, up to the end of their program; the tool of `state` stays where it is."""
    drawn = drawing(state)
    for part in blocks:
        current = sort_words(drawn, part, None)
        with current.placing():
            carry_out(drawn, current)
        if current.flow is not Flow.NEXT:
            break
    return elements_of(drawn, block, "CYCLE72")
