"""Blocks to moves: the order in which the codes of a block act.

The meaning of each code is a function in `codes`, found in the table of `codes.registry`; here is the order alone
(LinuxCNC's manual, "G-Code Overview", "Order of Execution").
"""

from toolpath_stiff.nc.codes.code import Code, code_name
from toolpath_stiff.nc.codes.cutter import check_block
from toolpath_stiff.nc.codes.drilling import CYCLES, begin_cycle
from toolpath_stiff.nc.codes.feeds import SLOWEST, bare_feed_is_open
from toolpath_stiff.nc.codes.increments import increments_hint, read_numbers
from toolpath_stiff.nc.codes.motion import homes_standing, record
from toolpath_stiff.nc.codes.passive import m_parameters
from toolpath_stiff.nc.codes.registry import CODES, REFUSED
from toolpath_stiff.nc.codes.tools import list_numbers
from toolpath_stiff.nc.geometry import GeometryError
from toolpath_stiff.nc.moves import FEED, RAPID
from toolpath_stiff.nc.state import LAST_MODE, CurrentBlock, Flow, Group, State, Then
from toolpath_stiff.nc.tables import LARGEST_MM, LARGEST_WORD
from toolpath_stiff.nc.words import AXES, CORNERS, Block, Word

NAMES = {"O": "program number", "$": "a setting of grbl or TinyG"}
WORDS_THAT_ACT = ("F", "S", "T")
PLACES = {letter: axis for axis, letter in enumerate(AXES)}
TAKERS: tuple[Group, ...] = ("non-modal", "rotation", "tool length")  # groups whose codes may take the axis words


def execute(state: State, block: Block) -> Then:
    """Execute a block; returns what runs after it. Raises `InputError` at a word, or at the block."""
    if not block.words or execute_straight(state, block):
        return Flow.NEXT
    return finish(state, begin(state, block))


def suits(state: State) -> bool:
    """True if the modes in force leave plain words their plain meaning."""
    frames = state.frames
    return (
        state.feed_mode == "G94"
        and state.polar is None
        and state.unsettled is None
        and state.corner is None
        and state.cutter is None
        and state.beside is None
        and not state.height_lost
        and not state.arc_absolute
        and not frames.bound
        and not frames.rotated
    )


def execute_straight(state: State, block: Block) -> bool:
    """Execute a plain block of G0 or G1, perhaps with G90 or G91; False, with nothing done, for any other one."""
    motion, feed, words, increments = state.motion, state.feed, dict[int, float](), state.dialect.increments
    absolute, coded, fed, measured = state.absolute, False, False, False
    for letter, value, _, text in block.words:
        if letter in PLACES:
            axis = PLACES[letter]
            if axis in words or abs(value) > LARGEST_MM or (increments and value and "." not in text):
                return False
            words[axis] = value if axis > 2 else value * state.length_scale
        elif letter == "G" and not coded and value in (0.0, 1.0):
            motion, coded = ("G0", "G1")[int(value)], True
        elif letter == "G" and not measured and value in (90.0, 91.0):
            absolute, measured = value == 90.0, True
        elif letter == "F" and not fed:
            feed, fed = value * state.feed_scale, True
            if not SLOWEST <= feed <= LARGEST_WORD or ("." not in text and bare_feed_is_open(state)):
                return False
        else:
            return False
    if motion not in ("G0", "G1") or (motion == "G1" and feed is None) or not suits(state):
        return False
    state.motion, state.feed, state.absolute, frames = motion, feed, absolute, state.frames
    if words:
        control = [*frames.position]
        for axis, value in words.items():
            control[axis] = frames.axis_to_control(axis, value) if absolute else control[axis] + value
        record(state, CurrentBlock(state.name, block), RAPID if motion == "G0" else FEED, control, words)
    return True


def begin(state: State, block: Block) -> CurrentBlock:
    """Take a block's codes and set its modes, without moving; repeating it changes nothing but dwells."""
    current = sort_words(state, block)
    read_numbers(state, current)
    check_block(state, current)
    for code in _in_order(current, ahead=True):
        code.act(state, current, code.name)
    if any(word.letter == "M" for word in block.words):
        m_parameters(state, current)
    return current


def finish(state: State, block: CurrentBlock) -> Then:
    """Carry out offsets and moves of a begun block; returns what runs after it."""
    _check_axis_words(block)
    for code in _in_order(block, ahead=False):
        code.act(state, block, code.name)
    pending = state.corner
    try:
        _move(state, block)
    except GeometryError as error:
        raise block.fail(None, error.found, error.expected, increments_hint(state)) from None
    for letter in CORNERS:
        if block.has(letter):
            CODES[letter].act(state, block, letter)
    if pending is not None and state.corner is pending:
        raise block.fail(None, f"line {pending.line} makes a corner with this block", "a feed move (G1)")
    list_numbers(state, block)
    for letter in sorted(block.free):
        raise block.fail(letter, "is not used by any code of its block", hint="remove it")
    return block.flow


def _in_order(block: CurrentBlock, ahead: bool) -> list[Code]:
    """Codes and words of a block, in order of execution: those that set modes (`ahead`), or those that act later."""
    codes = [code for name in block.groups.values() if (code := CODES[name]).when != "motion"]
    codes += [CODES[letter] for letter in WORDS_THAT_ACT if letter in block.values]
    return sorted((code for code in codes if (code.rank <= LAST_MODE) == ahead), key=lambda code: code.rank)


def sort_words(state: State, block: Block) -> CurrentBlock:
    """Sort the words; repeated words and two codes of one group are errors."""
    current = CurrentBlock(state.name, block)
    for word in block.words:
        if word.letter in "GM":
            _sort_code(state, current, word)
        elif word.letter in NAMES:
            state.note(block.line, word, NAMES[word.letter])
        else:
            current.add(word.letter, word)
    for letter in current.free & {"U", "V", "W"}:
        moves = not homes_standing(current, letter)
        current.refuse_if(moves, letter, "moves an axis that this machine does not have", "X Y Z A B C")
    return current


def _sort_code(state: State, block: CurrentBlock, word: Word) -> None:
    written, dialect = code_name(word.letter, word.value), state.dialect
    name = dialect.aliases.get(written, written)
    if name in REFUSED:
        raise block.fail(word, f"is {REFUSED[name].what}, which is not supported", hint=REFUSED[name].hint)
    code = CODES.get(name)
    unknown = code is None and word.letter == "G"
    block.refuse_if(unknown, word, "is not a G code that is known", hint="check the program, or post it without it")
    if code is None:  # unknown: it may run anything, even a change of kinematics; its parameters belong to it
        state.note_unknown(block.line, word)
        for other in block.block.words:
            if other.letter in "PQE":
                state.note(block.line, other, f"parameter of {word.text}")
        return
    acts = word.letter == "G" or code.group == "M subprogram"  # other unknown M codes are a machine builder's
    foreign = acts and name == written and dialect.name not in code.controls
    if foreign:
        hint = f"there it is {code.meaning}: name the control with --dialect"
        raise block.fail(word, f"is not a code of the dialect {dialect.name}", " or ".join(code.controls), hint)
    if code.listed:
        state.note(block.line, word, code.listed)
    before = block.groups.get(code.group)
    # `G0 G17 G40 G49 G80 G90`, the usual first block: G80 ends a cycle, the other code says what follows.
    if before is not None and (before == name or "G80" not in (before, name)):
        group = code.group.removeprefix("M ")
        problem = f"and {before} are both of the modal group {group!r}, or act once in their block"
        raise block.fail(word, problem, "one of them in a block")
    if before is None or name != "G80":
        block.groups[code.group] = name
        block.codes[name] = word


def _check_axis_words(block: CurrentBlock) -> None:
    """Refuse two codes that both use the axis words of their block."""
    present = [block.groups.get(group) for group in TAKERS]
    takers = [name for name in present if name is not None and CODES[name].takes_axes]
    moving = block.groups.get("motion")
    if takers in (["G28"], ["G30"]) and moving in ("G0", "G1"):  # it homes, and the motion mode is in force afterwards
        return
    if len(takers) > 1 or (takers and moving and moving != "G80"):
        other = moving if moving and len(takers) == 1 else takers[0]
        raise block.fail(block.codes[takers[-1]], f"and {other} both use the axis words of their block", "two blocks")


def _move(state: State, block: CurrentBlock) -> None:
    """Change the motion mode, and move as the block requires."""
    given = block.groups.get("motion")
    if given is not None:
        if given in (*CYCLES, "G80") and state.dialect.increments and state.motion not in CYCLES:
            state.group_01 = state.motion
        if given in CYCLES:
            begin_cycle(state, given)
        state.motion = given
        if given == "G80":
            CODES[given].act(state, block, given)
    once = block.groups.get("non-modal")
    instead = once if once is not None and CODES[once].when == "motion" else None  # G53
    if state.motion is None:
        for letter in AXES:
            block.refuse_if(block.has(letter), letter, "has no motion mode to move in", "G0 to G3 or a cycle before it")
        block.refuse_if(instead is not None, instead, "without G0 or G1")
    else:
        mode = instead or state.motion
        CODES[mode].act(state, block, mode)
