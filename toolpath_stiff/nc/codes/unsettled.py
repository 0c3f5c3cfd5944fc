"""What is refused where controls would take other points: after G68, G69 and G10 turned the coordinates."""

from toolpath_stiff.nc.state import CurrentBlock, State
from toolpath_stiff.nc.words import AXES, Word

XY = frozenset((0, 1))
TURNED = "G10, or another work offset and M6, turned the coordinates: LinuxCNC's interpreter may have other ones"


def refuse_while_rotated(state: State, block: CurrentBlock, word: Word | str, what: str) -> None:
    """Refuse what Fanuc's controls forbid between G68 and G69."""
    if state.frames.rotation is not None:
        raise block.fail(word, f"{what} while the coordinate system is rotated (G68)", "G69 before it")


def zero_moved(state: State) -> None:
    """Note that the zero of turned coordinates moved: LinuxCNC's rs274 forgets it at the next M6."""
    if state.frames.offsets.at(state.frames.active).rotation:
        state.rotation_changed = True


def know_place(state: State, block: CurrentBlock, word: Word) -> None:
    """Refuse what depends on the present X and Y, after a G10 that turned the offset in force."""
    if state.unsettled == "G10":
        raise block.fail(word, f"depends on the present X and Y. {TURNED}", "a move with both X and Y before it")


def settle(state: State, block: CurrentBlock, words: dict[int, float]) -> None:
    """Refuse what a control may read as another point: X and Y had other numbers before the rotation changed."""
    named, complete = XY & words.keys(), state.absolute and words.keys() >= XY
    if complete:
        state.unsettled = None
    elif state.unsettled == "G10":
        raise block.fail(None, f"{TURNED}, and the next move does not name both X and Y", "both, in G90")
    elif named and (state.absolute or state.unsettled == "G69"):
        word = block.values[AXES[min(named)]]
        raise block.fail(word, f"alone, or incremental, in the first move after {state.unsettled}", "X and Y, in G90")
