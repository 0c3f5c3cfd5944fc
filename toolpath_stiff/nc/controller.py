"""The controller: its dialect, and its file, which holds settings of the control rather than of the machine.

Of the dialects, `generic` is the meaning that most programs share: plain numbers, LinuxCNC's start-up state; a block
from which Fanuc's controls and LinuxCNC would make different paths is refused. The other dialects decide it. Sources:
LinuxCNC's manual ("G-Code overview", "Canned cycles"); Fanuc's operator's manuals ("Decimal point programming",
"Canned cycle"); Haas' "Help with the decimal points" (settings 77 and 162) and mill operator's manual (G70 to G72,
G98).

A controller file is TOML, in mm and degrees. Its keys are `dialect`, `block_delete`, `arc_centers`, `inch_metric`,
`offsets` (a table, or a file), `tools` (a list of tables, or a file), `kinematics` (a table, see `kinematics`: the
machine that programs were posted for), `setup` (the name of the clamping arrangement, for effects of the machine that
belong to one). LinuxCNC's own parameter file (.var) and tool table (.tbl) are read as controller files too.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from toolpath_stiff.errors import ProgramError
from toolpath_stiff.nc.kinematics import PostedKinematics, read_kinematics
from toolpath_stiff.nc.tables import (
    LARGEST_WORD,
    Offsets,
    ToolEntry,
    offsets_of,
    read_offsets,
    read_tool_table,
    tools_of,
)
from toolpath_stiff.toml_reader import TomlReader, is_text

# IS-B, the increment system of nearly every Fanuc and Haas: what a number without a decimal point counts.
INCREMENT_MM, INCREMENT_INCH, INCREMENT_DEGREE = 1e-3, 1e-4, 1e-3

SECONDS, MILLISECONDS, BY_POINT = "s", "ms", "ms without, s with a decimal point"
INCH_METRIC = {"G70": "G20", "G71": "G21"}


@dataclass(frozen=True)
class Dialect:
    """Meanings in which controls differ.

    Attributes
    ----------
    name
        As `--dialect` takes it.
    increments
        Lengths and angles without a decimal point count least increments: `X10` is 0.01 mm and `X10.` 10 mm.
    dwell
        What the P of G4 and of cycles counts; with milliseconds, G4 X is a time too.
    retract
        G98 or G99 at the start; None: not defined, LinuxCNC's G99 is assumed and listed.
    keeps_heights
        Whether a drilling cycle's hole keeps its depth when G90 or G91 follows, or Z and R are read again (LinuxCNC);
        None: refused.
    repeats_in_p
        `M98 P21000` is two runs of O1000 (True), O21000 (False), or whichever the file has (None).
    cycle_repeats
        The words that say how often a cycle's block drills.
    semicolon
        Whether `;` begins a comment; else it ends the block, and nothing may follow it.
    arc_absolute
        Whether I, J, K are absolute at the start (G90.1).
    aliases
        Its other names of codes.
    additional
        The codes that take additional work offsets.
    feed_needs_point
        Units in which F without a decimal point depends on a parameter, and is refused.
    """

    name: str
    increments: bool = False
    dwell: str = SECONDS
    retract: str | None = None
    keeps_heights: bool | None = None
    repeats_in_p: bool | None = None
    cycle_repeats: str = "L"
    semicolon: bool = True
    arc_absolute: bool = False
    aliases: Mapping[str, str] = field(default_factory=dict)
    additional: tuple[str, ...] = ("G54.1", "G154")
    feed_needs_point: tuple[str, ...] = ()


GENERIC = Dialect("generic")
DIALECTS = {
    dialect.name: dialect
    for dialect in (
        GENERIC,
        Dialect("linuxcnc", keeps_heights=False, repeats_in_p=False, additional=()),
        Dialect(
            "fanuc",
            increments=True,
            dwell=MILLISECONDS,
            retract="G98",
            keeps_heights=True,
            repeats_in_p=True,
            cycle_repeats="KL",
            semicolon=False,
            aliases=INCH_METRIC,
            additional=("G54.1",),
            feed_needs_point=("inch",),
        ),
        Dialect(
            "haas",
            increments=True,
            dwell=BY_POINT,
            retract="G98",
            keeps_heights=True,
            repeats_in_p=False,
            semicolon=False,
            additional=("G154",),
            feed_needs_point=("mm", "inch"),
            aliases={"G234": "G43.4"},
        ),
        Dialect("heidenhain", retract="G98", repeats_in_p=False, additional=()),
        Dialect("siemens", additional=()),
    )
}
# Dialects that are separate languages, each with its reader -> their names.
LANGUAGES = {"heidenhain": "Heidenhain's conversational language", "siemens": "Siemens' own language (Sinumerik)"}


def dialect_named(name: str) -> Dialect:
    """Dialect by name. Raises `InputError`.

    Examples
    --------
    >>> dialect_named("fanuc").increments
    True
    """
    if name not in DIALECTS:
        raise ProgramError(f"dialect {name!r}", expected=", ".join(DIALECTS))
    return DIALECTS[name]


ALL_SWITCHES = frozenset(range(1, 10))
KEYS = (
    "dialect", "block_delete", "arc_centers", "inch_metric", "offsets", "tools", "kinematics", "setup",
    "feed_mm_per_min", "subprograms",
)  # fmt: skip


@dataclass(frozen=True)
class Controller:
    """Known settings of the control.

    Attributes
    ----------
    dialect
        The meaning of words in which controls differ.
    switches
        Block-delete switches that are on.
    offsets, tools
        Work offsets and tool table; None where the file has none.
    kinematics
        The machine that programs were posted for; None: A, B, C are roll, pitch, yaw of the platform.
    setup
        Name of the clamping arrangement; None where the file has none.
    feed
        Feed of cuts before the first F of a program, mm/min; None: such a cut is refused.
    subprograms
        Folder of the files that programs call (`o<name> call`, `M98 P1234`); None: they call none.
    """

    dialect: Dialect = GENERIC
    switches: frozenset[int] = field(default_factory=frozenset)
    offsets: Offsets | None = None
    tools: dict[int, ToolEntry] | None = None
    kinematics: PostedKinematics | None = None
    setup: str | None = None
    feed: float | None = None
    subprograms: str | None = None

    @property
    def plain(self) -> bool:
        """True if LinuxCNC's interpreter reads numbers, switches and codes the same way."""
        return self.dialect in (GENERIC, DIALECTS["linuxcnc"]) and self.switches in (frozenset(), ALL_SWITCHES)

    def check_plain(self) -> None:
        """Raise `InputError` if LinuxCNC's interpreter would read a program differently from the control."""
        if not self.plain:
            other = f"this control's is {self.dialect.name!r}, or it has single block-delete switches"
            problem = f"LinuxCNC's interpreter knows its own dialect only, and {other}"
            raise ProgramError(problem, hint="use the built-in interpreter (--interpreter builtin)")

    @property
    def label(self) -> str:
        """Name of the dialect, with a note if a controller file changes it."""
        name = self.dialect.name
        return name if self.dialect == DIALECTS[name] else f"{name}, changed by the controller file"


UNKNOWN_CONTROL = Controller()


def read_controller(path: str | Path, dialect: str | None = None) -> Controller:
    r"""Read a controller file; .var and .tbl files are LinuxCNC's. `dialect`, if given, replaces the file's.

    Raises `InputError` that names file and key.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "mill.toml"
    ...     _ = file.write_text('dialect = "haas"\n[offsets]\nG54 = [100, 0, -20]\n')
    ...     controller = read_controller(file)
    >>> controller.label, controller.offsets.table[0].axes
    ('haas', [100.0, 0.0, -20.0, 0.0, 0.0, 0.0])
    """
    suffix, base = Path(path).suffix.lower(), Controller(dialect_named(dialect or "linuxcnc"))
    if suffix == ".var":
        return replace(base, offsets=read_offsets(path))
    if suffix == ".tbl":
        return replace(base, tools=read_tool_table(path))
    toml = TomlReader.read(path, "the controller file", ProgramError)
    toml.only("", toml.data, KEYS)
    given = toml.data

    def choice(key: str, *choices: str) -> str:
        return toml.choice(key, given.get(key, choices[0]), choices, " or ".join(choices))

    name = choice("dialect", *DIALECTS)
    control = dialect_named(dialect or name)
    absolute = choice("arc_centers", "incremental", "absolute") == "absolute"
    by_g70 = choice("inch_metric", "G20 G21", "G70 G71") == "G70 G71"
    aliases = {**control.aliases, **INCH_METRIC} if by_g70 else control.aliases
    setup, feed, folder = given.get("setup"), given.get("feed_mm_per_min"), given.get("subprograms")
    if setup is not None and not is_text(setup):
        raise toml.error(f"setup = {setup!r}", "the name of a set-up", where="setup")
    if feed is not None and not toml.number("feed_mm_per_min", feed, LARGEST_WORD) > 0.0:
        raise toml.error(f"feed_mm_per_min = {feed:g}", "more than 0", where="feed_mm_per_min")
    if folder is not None:
        beside = Path(toml.file).parent / folder if is_text(folder) else None
        if beside is None or not beside.is_dir():
            raise toml.error(f"subprograms = {folder!r}", "a folder beside this file", where="subprograms")
        folder = str(beside)
    control = replace(control, arc_absolute=control.arc_absolute or absolute, aliases=aliases)
    tables = offsets_of(toml), tools_of(toml), read_kinematics(toml)
    return Controller(control, _switches(toml), *tables, setup, feed, folder)


def _switches(toml: TomlReader) -> frozenset[int]:
    value = toml.data.get("block_delete", False)
    if isinstance(value, bool):
        return ALL_SWITCHES if value else frozenset()
    if isinstance(value, list) and all(type(v) is int and v in ALL_SWITCHES for v in value):
        return frozenset(value)
    raise toml.error(f"block_delete = {value!r}", "true, false, or a list of switches 1 to 9", where="block_delete")
