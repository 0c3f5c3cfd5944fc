"""A code: its name, its modal group (`state`), its function, and the manual that it follows.

Each module here has a group of codes, each a function and a row; `registry` joins the rows to one table.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from toolpath_stiff.nc.state import STEPS, CurrentBlock, Group, State

EVERYWHERE = ("generic", "linuxcnc", "fanuc", "haas")
FANUC, HAAS = "Fanuc, operator's manuals", "Haas, mill operator's manual"
Act = Callable[[State, CurrentBlock, str], None]


@dataclass(frozen=True)
class Code:
    """A code that is understood.

    Attributes
    ----------
    name
        "G1", "G59.3", "M6"; "F", "S", "T", ",C" and ",R" act as words.
    group
        Its modal group; two codes of one are an error.
    act
        What it does: a function of the state, the current block and the code's name. A motion code's is called for
        each block as long as its mode is in force.
    meaning
        In a few words.
    source
        The manual and section that it follows.
    controls
        The dialects that have it.
    step
        When it acts, unless its group says so; one of `MOTION` moves in place of the mode in force.
    takes_axes
        Whether it takes the axis words of its block, which then cannot move.
    listed
        Why it is listed as not acted upon, although it is understood.
    many
        Whether plain lines of it are executed many at a time (`plain_lines`), by the same rules on arrays.
    """

    name: str
    group: Group
    act: Act
    meaning: str
    source: str
    controls: tuple[str, ...] = EVERYWHERE
    step: Group | None = None
    takes_axes: bool = False
    listed: str = ""
    many: bool = False

    @property
    def when(self) -> Group:
        """Step of the order of execution at which it acts."""
        return self.step or self.group

    @property
    def rank(self) -> int:
        """Position in the order of execution."""
        return STEPS[self.when]


@dataclass(frozen=True)
class Refused:
    """An unsupported code that changes the path, or the effect of a force on it: its meaning, and a hint."""

    name: str
    what: str
    hint: str
    source: str


def family(
    meanings: Mapping[str, str],
    group: Group,
    act: Act,
    source: str,
    controls: tuple[str, ...] = EVERYWHERE,
    listed: str = "",
) -> tuple[Code, ...]:
    """Codes with one function, by their names and meanings.

    Examples
    --------
    >>> [code.name for code in family({"M3": "on", "M5": "off"}, "M spindle", holds_anyway, m_codes("M3 M4 M5"))]
    ['M3', 'M5']
    """
    return tuple(Code(name, group, act, text, source, controls, listed=listed) for name, text in meanings.items())


Rows = tuple[tuple[Group, str, tuple[tuple[str, Act, str], ...]], ...]  # group, source, and names, function, meaning


def table(rows: Rows, controls: tuple[str, ...], between: str | None = None) -> dict[str, Code]:
    """Codes of a language by name; names are separated by blanks, or by `between`."""
    return {
        name: Code(name, group, act, meaning, source, controls)
        for group, source, members in rows
        for names, act, meaning in members
        for name in names.split(between)
    }


def refused(rows: Iterable[tuple[str, str, str, str]], between: str | None = None) -> dict[str, Refused]:
    """Refused codes by name: names separated by blanks or by `between`, their meaning, a hint, the source."""
    return {name: Refused(name, what, hint, at) for names, what, hint, at in rows for name in names.split(between)}


def code_name(letter: str, value: float) -> str:
    """Name of a code: `G` and 59.3 give "G59.3", `G` and 1.0 give "G1".

    Examples
    --------
    >>> code_name("G", 59.3), code_name("G", 1.0)
    ('G59.3', 'G1')
    """
    return f"{letter}{value:g}"


def g_codes(section: str) -> str:
    """A section of LinuxCNC's page on G codes, as a source."""
    return f"LinuxCNC, G-Codes, {section}"


def m_codes(section: str) -> str:
    """A section of LinuxCNC's page on M codes, as a source."""
    return f"LinuxCNC, M-Codes, {section}"


def holds_anyway(state: State, block: CurrentBlock, code: str) -> None:
    """Do nothing: the code does not affect a path, or its state holds anyway."""
