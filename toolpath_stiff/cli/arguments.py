"""Arguments that several commands share: the types that read them, the inputs and the outputs that they name.

What a command writes may not be what it reads: one check for all of them, before any work is done. Every argument that
names a file is an input, but those that say where results go. With `--replace` (`--force` is the same where it has no
other meaning) the old file is kept beside the new one.
"""

from __future__ import annotations

import argparse
import math
import re
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, cast

from toolpath_stiff.api.inputs import FARTHEST_DEG, FARTHEST_MM, finite
from toolpath_stiff.defaults import FORCE, LOAD, MACHINE
from toolpath_stiff.errors import InputError, harmless
from toolpath_stiff.files import Content, check_outputs, encoded, is_file, keep_old, read_bytes
from toolpath_stiff.results_folder import Rules, check_folder, holds_others, incomplete, write_folder
from toolpath_stiff.units import ShopPose

if TYPE_CHECKING:
    from toolpath_stiff.api.inputs import Program, Reading
    from toolpath_stiff.api.machines import Machine
    from toolpath_stiff.results import FolderResult, Progress

SWITCHES = re.compile(r"[1-9](?:,[1-9])*")  # of block delete
ALL_BLOCKS = "all"
LOADS_HELP = "tangential, axial, normal, softest, radial, x, y, z or DX,DY,DZ"
LONGEST = 60  # letters of a default folder's name; of more files, the first and how many there are
PNG, PNG_HEAD_BYTES = b"\x89PNG", 54  # signature, IHDR and pHYs, in which other writers differ
MARK_BYTES = 4096  # of a file, within which a command knows what it wrote itself
DESTINATIONS = ("out", "output", "write")


def finite_number(text: str) -> float:
    """A number that is neither infinite nor nan, in plain digits: Python would also read `1_000`."""
    try:
        return finite("", math.nan if "_" in text else text)
    except InputError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number") from None


def positive_number(unit: str, highest: float) -> Callable[[str], float]:
    """A type for numbers above 0 and up to `highest`, in `unit`."""

    def read(text: str) -> float:
        value = finite_number(text)
        if not 0.0 < value <= highest:
            raise argparse.ArgumentTypeError(f"{text} {unit}: expected more than 0 and at most {highest:g} {unit}")
        return value

    return read


def pose_argument(text: str) -> ShopPose:
    """`X,Y,Z` or `X,Y,Z,A,B,C` in mm and degrees."""
    parts = text.split(",")
    if len(parts) not in (3, 6):
        raise argparse.ArgumentTypeError(f"{text!r}: expected X,Y,Z or X,Y,Z,A,B,C in mm and degrees")
    x, y, z, *angles = (finite_number(part) for part in parts)
    a, b, c = angles or (0.0, 0.0, 0.0)
    if max(abs(x), abs(y), abs(z)) > FARTHEST_MM or max(abs(a), abs(b), abs(c)) > FARTHEST_DEG:
        raise argparse.ArgumentTypeError(
            f"{text!r}: expected positions within +-{FARTHEST_MM:g} mm and angles within +-{FARTHEST_DEG:g} degrees"
        )
    return (x, y, z, a, b, c)


def range_argument(text: str) -> tuple[float, float]:
    """`LO:HI`, or one number for both ends; in the unit of the option."""
    parts = text.split(":")
    if len(parts) not in (1, 2):
        raise argparse.ArgumentTypeError(f"{text!r}: expected LO:HI or one number")
    low, high = finite_number(parts[0]), finite_number(parts[-1])
    if low > high:
        raise argparse.ArgumentTypeError(f"{text!r}: the lower bound {low:g} is above the upper bound {high:g}")
    return low, high


def switches_argument(text: str) -> frozenset[int] | bool:
    """Block-delete switches, `2,3`; `all` is what the option means without a value."""
    if text == ALL_BLOCKS:
        return True
    if not SWITCHES.fullmatch(text):
        raise argparse.ArgumentTypeError(f"{text!r}: expected switches 1 to 9, as 2,3")
    return frozenset(map(int, text.split(",")))


def whole_options(arguments: Sequence[str]) -> list[str]:
    """`--block-delete` before anything but switches is the whole option: what follows is a program."""
    return [
        f"{word}={ALL_BLOCKS}" if word == "--block-delete" and not SWITCHES.fullmatch(after) else word
        for word, after in zip(arguments, [*arguments[1:], ""], strict=False)
    ]


def load_argument(text: str) -> str:
    """Check `--load` early; the analysis parses it again."""
    from toolpath_stiff.analysis.loads import parse_load

    try:
        parse_load(text)
    except InputError as error:
        raise argparse.ArgumentTypeError(str(error)) from None
    return text


def add_program_options(parser: argparse.ArgumentParser, *, sampled: bool = True, placed: bool = True) -> None:
    """Options about how a program is read and, where it is `sampled`, how finely, where `placed`, at which origin."""
    group = parser.add_argument_group("program")
    if placed:
        group.add_argument(
            "--origin",
            type=pose_argument,
            metavar="X,Y,Z[,A,B,C]",
            help="where program zero (G54) sits in machine coordinates, mm and degrees "
            "(default: where the program's G10 says, else the machine's default)",
        )
    if sampled:
        group.add_argument(
            "--step",
            type=positive_number("mm", 1000.0),
            default=1.0,
            metavar="MM",
            help="distance of the samples (default: 1)",
        )
    add_reading_options(group)
    _add_interpreter_options(group)


def add_reading_options(group: argparse._ActionsContainer) -> None:
    """What belongs to the control."""
    group.add_argument("--offsets", metavar="FILE", help="work offsets G54 to G59.3")
    group.add_argument("--tools", metavar="FILE", help="tool table: LinuxCNC .tbl, or CSV tool,length_mm,diameter_mm")
    group.add_argument(
        "--controller",
        metavar="FILE",
        help="what belongs to the control (TOML: dialect, block_delete, offsets, tools, the kinematics "
        "that the program was posted for; or LinuxCNC's .var or .tbl)",
    )
    group.add_argument(
        "--dialect",
        choices=("generic", "linuxcnc", "fanuc", "haas"),
        help="the control, for what controls read differently: X10 without a decimal point, the time of G4 P, "
        "G70 and G71, `;` (default: the controller file's, else generic)",
    )
    group.add_argument(
        "--block-delete",
        nargs="?",
        const=True,
        default=False,
        type=switches_argument,
        metavar="N,N",
        help="leave out blocks that begin with / (with 2,3: those that begin with /2 or /3; / is /1)",
    )
    group.add_argument(
        "--feed",
        type=positive_number("mm/min", 1e6),
        metavar="MM_PER_MIN",
        help="feed of cuts before the program's first F (a cutter-location file's first FEDRAT)",
    )


def _add_interpreter_options(group: argparse._ArgumentGroup) -> None:
    group.add_argument(
        "--interpreter",
        choices=("builtin", "linuxcnc", "auto"),
        default="builtin",
        help="what reads the program: the built-in reader; LinuxCNC's rs274; "
        "auto: rs274 where the built-in reader refuses the program (default: builtin)",
    )
    group.add_argument(
        "--subprograms",
        metavar="FOLDER",
        help="folder of the files that programs call: name.ngc for o<name> call, O1234.nc for M98 and G65 P1234",
    )
    group.add_argument("--rs274", metavar="PATH", help="LinuxCNC's interpreter, if it is not on PATH")
    group.add_argument(
        "--unconfined",
        action="store_true",
        help="run rs274 even where bubblewrap, which keeps it from all files but its own, cannot be used",
    )


def add_machine_options(parser: argparse.ArgumentParser) -> None:
    """Options about the machine and its physics."""
    group = parser.add_argument_group("machine")
    group.add_argument(
        "--machine", default=MACHINE, metavar="NAME|FILE", help=f"machine name or machine file (default: {MACHINE})"
    )
    group.add_argument(
        "--effects", action="append", default=[], metavar="FILE.py", help="file with your own physical effects"
    )
    add_unchecked_option(group)
    group.add_argument(
        "--force",
        type=positive_number("N", 1e6),
        default=FORCE,
        metavar="N",
        help=f"load at the tool tip, for deflections and load-dependent effects (default: {FORCE:g})",
    )
    add_condition_options(group)


def add_unchecked_option(group: argparse._ActionsContainer) -> None:
    """`--allow-unchecked-effects`, beside `--effects`."""
    group.add_argument(
        "--allow-unchecked-effects",
        action="store_true",
        help="compute even with own effects that fail `tps effects check`; every result says so",
    )


def add_condition_options(group: argparse._ActionsContainer) -> None:
    """Under what a program runs, which measurements say reading by reading."""
    group.add_argument(
        "--setup",
        type=_setup_name,
        metavar="NAME",
        help="set-up that is on the machine, for effects that belong to one; none: a set-up without a name "
        "(default: the controller file's, else the machine file's)",
    )
    group.add_argument(
        "--temperature",
        type=_temperature,
        metavar="C",
        help="degrees C, for effects that need it (default: the machine file's)",
    )


def _setup_name(text: str) -> str:
    if not text.strip():
        raise argparse.ArgumentTypeError("an empty name: expected a set-up, or none")
    return text.strip()


def _temperature(text: str) -> float:
    value = finite_number(text)
    if not -50.0 <= value <= 200.0:
        raise argparse.ArgumentTypeError(f"{text} degrees C: expected -50 to 200")
    return value


def machine_for(args: argparse.Namespace) -> Machine:
    """The machine that the options of `add_machine_options` describe. Raises `InputError`."""
    return loaded_machine(args).under(args.setup, args.temperature)


def loaded_machine(args: argparse.Namespace) -> Machine:
    """The machine of --machine with its effects. Raises `InputError`."""
    from toolpath_stiff.api.machines import Machine

    return Machine.load(args.machine, effects=args.effects, allow_unchecked_effects=args.allow_unchecked_effects)


def add_load_options(parser: argparse.ArgumentParser) -> None:
    """The direction of the load."""
    parser.add_argument(
        "--load",
        type=load_argument,
        default=LOAD,
        metavar="DIRECTION",
        help=f"{LOADS_HELP} (default: tangential)",
    )


def add_json_option(parser: argparse.ArgumentParser, text: str) -> None:
    """`--json`, with what it prints."""
    parser.add_argument("--json", action="store_true", help=text)


def reading_options(args: argparse.Namespace) -> dict[str, Any]:
    """What the options of `add_program_options` say of the reading, as keywords of `Program.read`."""
    return {
        "dialect": args.dialect,
        "controller": args.controller,
        "offsets": args.offsets,
        "tools": args.tools,
        "block_delete": args.block_delete,
        "interpreter": args.interpreter,
        "rs274": args.rs274,
        "feed_mm_per_min": args.feed,
        "subprograms": args.subprograms,
        "unconfined": args.unconfined,
    }


def case_reading(args: argparse.Namespace) -> Reading:
    """What the options of `add_reading_options` say, as a case keeps it: no more than was given."""
    given = {name: getattr(args, name) for name in ("dialect", "controller", "offsets", "tools", "block_delete")}
    said = {**given, "feed_mm_per_min": args.feed}
    return cast("Reading", {name: value for name, value in said.items() if value not in (None, False)})


def program_for(args: argparse.Namespace, file: str) -> Program:
    """A program with the options of `add_program_options`. Raises `InputError`."""
    from toolpath_stiff.api.inputs import Program

    return Program.read(file, **reading_options(args))


def add_replace_option(parser: argparse.ArgumentParser, *, force: bool = True) -> None:
    """`--replace`, and `--force` for the same unless that means something else here."""
    parser.add_argument(
        "--replace",
        *(["--force"] if force else []),
        action="store_true",
        dest="replace",
        help="replace existing files that the tool did not write; the old ones are kept as NAME.old",
    )


def inputs_of(args: argparse.Namespace) -> Iterator[str]:
    """Every argument that may name a file to read; of a workbook's sheet, the workbook."""
    from toolpath_stiff.workbooks import split_name

    for name, value in vars(args).items():
        if name not in DESTINATIONS:
            named = [one for one in (value if isinstance(value, list) else [value]) if isinstance(one, str) and one]
            yield from (split_name(one)[0] for one in named)


def tell_incomplete(folders: Iterable[Path]) -> None:
    """Say which of these folders hold the results of a run that was stopped."""
    for told in filter(None, map(incomplete, dict.fromkeys(folders))):
        print(f"tps: warning: {told}", file=sys.stderr)


def read_folders(args: argparse.Namespace) -> list[Path]:
    """The folders that a command reads from."""
    found = []
    for name in inputs_of(args):
        with suppress(OSError, ValueError):  # no file can have that name
            found += [Path(name) if Path(name).is_dir() else Path(name).parent] if Path(name).exists() else []
    return found


def check_written(
    args: argparse.Namespace, files: Iterable[str | Path | None], more_inputs: Iterable[str | Path] = ()
) -> list[Path]:
    """Refuse to write over an input; the inputs that are to be replaced, for `keep`.

    `files` are all that the command will write or remove. Raises `InputError`, which names --replace.
    """
    outputs = [file for file in files if file]
    return check_outputs(outputs, [*inputs_of(args), *more_inputs], args.replace)


def check_new(args: argparse.Namespace, file: str) -> list[Path]:
    """The same for a template, which writes over nothing at all."""
    if Path(file).exists() and not args.replace:
        raise InputError(
            f"{file!r} exists already", hint="choose another name, or say --replace: the old file is kept beside it"
        )
    return [Path(file)] if Path(file).exists() else []


def check_single(args: argparse.Namespace, file: str | None, mark: bytes = b"") -> list[Path]:
    """The same for one file of a name that the user chose; what stands there is to be kept unless it bears the mark.

    A single file has no record of what wrote it, as a folder has: `mark` is at the head of what the tool writes.
    """
    replaced = check_written(args, [file])
    if not file or replaced or not is_file(file):
        return replaced
    try:
        with Path(file).open("rb") as stream:
            ours = bool(mark) and mark in stream.read(MARK_BYTES)
    except OSError:
        ours = False
    return [] if ours else [Path(file)]


def check_made(args: argparse.Namespace, contents: Mapping[Path, Content]) -> list[Path]:
    """The same for files whose content is made already; what stands there is to be kept unless it is the tool's.

    That is what has the same content, and a picture of the same size and resolution that begins as ours do.
    """
    replaced = check_written(args, contents)
    for file, content in contents.items():
        made = b"".join(encoded(content))
        begin = made[:PNG_HEAD_BYTES] if made.startswith(PNG) else made
        if file not in replaced and is_file(file):
            found = read_bytes(file, "file")
            if found != made and not (begin is not made and found.startswith(begin)):
                replaced.append(file)
    return replaced


def keep(replaced: Iterable[Path], quiet: bool = False) -> None:
    """Keep what is about to be replaced, and say where."""
    for file in replaced:
        kept = keep_old(file)
        if kept is not None and not quiet:
            tell_kept(file, kept)


def tell_kept(file: Path, kept: Path) -> None:
    """Say where an old file is."""
    print(f"kept the old {file} as {kept}")


@dataclass(frozen=True)
class Destination:
    """The folder for the results of a run, by what command, and what must not be replaced there."""

    folder: Path
    command: str
    rules: Rules

    def check(self, names: Iterable[str]) -> Destination:
        """Itself, if files of these names could be written. Raises `InputError`."""
        check_folder(self.folder, names, self.rules)
        return self

    def write(
        self,
        contents: Mapping[str, Content | Callable[[], Content]],
        elsewhere: Mapping[str | Path, Content] = MappingProxyType({}),
    ) -> list[Path]:
        """Write the files, all or none, and those elsewhere; see `write_folder`."""
        return write_folder(self.folder, contents, command=self.command, rules=self.rules, elsewhere=elsewhere)


def show(
    args: argparse.Namespace,
    result: FolderResult,
    target: Destination,
    also: Mapping[str | Path, Content] = MappingProxyType({}),
    **options: Any,
) -> int:
    """Save a result and the files `also`, print it as text or as JSON; the exit code of success."""
    files = result.files(plots=not args.no_plots, **options)
    written = [*target.write(files, also), *map(Path, also)]
    if args.json:
        sys.stdout.write(result.to_json())
    else:
        print(f"{result}\n{written_text(written)}")
    return 0


def written_text(files: Iterable[Path]) -> str:
    """What was written, a file a line."""
    from toolpath_stiff.report.words import plain

    return "\n".join(["written:", *(f"  {plain(str(file))}" for file in files)])


def destination(args: argparse.Namespace, command: str, sources: Sequence[str], suffix: str = "") -> Destination:
    """The folder of --out, else `reports/<sources><suffix>` or a longer name, which then belongs to these sources."""
    rules = Rules(
        inputs=tuple(inputs_of(args)),
        of=() if args.out else tuple(sources),
        replace=args.replace,
        kept=None if args.json else tell_kept,
    )
    return Destination(Path(args.out) if args.out else _default_folder(sources, suffix), command, rules)


def _default_folder(sources: Sequence[str], suffix: str) -> Path:
    """`reports/NAME`; where that holds results of another file of the name, the folder above stands before it."""
    from toolpath_stiff.workbooks import split_name

    name = joined_names(sources)
    default = folder = Path(f"reports/{name}{suffix}")
    for above in Path(split_name(sources[0])[0]).absolute().parents:
        if not holds_others(folder, sources):
            return folder
        name = f"{above.name}-{name}"
        folder = Path(f"reports/{name}{suffix}")
    return default


def joined_names(sources: Sequence[str]) -> str:
    """Files by their names without folder, ending and sheet: `first+second`."""
    from toolpath_stiff.workbooks import split_name

    names = [Path(split_name(source)[0]).stem for source in sources]
    joined = "+".join(names)
    return joined if len(joined) <= LONGEST or len(names) == 1 else f"{names[0]}+{len(names) - 1}"


# -- progress ----------------------------------------------------------------------------------------------------------

QUIET_SECONDS = 0.5  # work shorter than this shows no bar
REDRAW_SECONDS = 0.1
WIDTH = 30


def say(text: str) -> None:
    """Replace the line of progress, where someone watches; "" takes it away."""
    if sys.stderr.isatty():
        # The one text that steers the terminal, past what takes control characters out of all others.
        stream = getattr(sys.stderr, "stream", sys.stderr)
        stream.write(f"\r\x1b[K{harmless(text)}")
        stream.flush()


@contextmanager
def progress_line(quiet: bool = False) -> Iterator[Progress | None]:
    """Yield what functions of the library call with (text, done, in all), or None where nobody watches.

    What has a number is drawn as a bar, once it takes longer than a moment; the line is taken away at the end.
    """
    if quiet or not sys.stderr.isatty():
        yield None
        return
    started: dict[str, float] = {}
    last = 0.0

    def draw(text: str, done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        start = started.setdefault(text, now)
        if not total:
            say(text)
            return
        if now - start < QUIET_SECONDS or now - last < REDRAW_SECONDS:
            return
        last = now
        filled = WIDTH * done // total
        bar = "#" * filled + "." * (WIDTH - filled)
        left = (now - start) * (total - done) / max(done, 1)
        say(f"{text} [{bar}] {done}/{total}, {left:.0f} s left ")

    try:
        yield draw
    finally:
        say("")
