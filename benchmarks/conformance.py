"""`python -m benchmarks.conformance [FILE|FOLDER ...]`: the built-in reader against LinuxCNC's interpreter.

Without arguments: every sample program that Debian's `linuxcnc-uspace` installs. The committed table is of every
program in LinuxCNC's own repository (`nc_files`, `configs`, `tests`), as Debian's source package has it: the folder
that `apt-get source linuxcnc` makes is the argument. The programs are LinuxCNC's (GPL) and no part of this project.

The built-in reader must give the feed path that `rs274` gives, within 0.01 mm and 0.01 degrees in both directions, or
refuse with file and line; never another path. Both take the program for LinuxCNC's (`--dialect linuxcnc`). Exit code 1
if one differs.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.pages import page_parser, table, tell
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.nc.controller import DIALECTS, Controller
from toolpath_stiff.nc.moves import RAPID, Moves, ReadProgram
from toolpath_stiff.nc.reader import read_program
from toolpath_stiff.nc.tables import read_tool_table
from toolpath_stiff.path.sampling import sample_moves

PACKAGE = "linuxcnc-uspace"
TOLERANCE = 0.01  # mm and degrees
PRINTED = 0.005  # two digits of 0.0001 inch: a move shorter than that may be lost in print
LINUXCNC = Controller(DIALECTS["linuxcnc"])
AT_ONCE = 100_000  # pairs of a point and a segment: what stays in a processor's cache
SUFFIXES = (".ngc", ".nc")
SAME, NONE, REFUSED, UNCHECKED, OTHER = "same path", "no feed path", "refused", "not checked", "OTHER PATH"
# The programs name tools without saying how long they are: any length will do, and both readers get the same.
TOOL_TABLE = "tool,length_mm,diameter_mm\n" + "".join(f"{n},{50 + n},6\n" for n in range(1, 100))


@dataclass(frozen=True)
class Row:
    """One program: what became of it, what LinuxCNC's interpreter and what the built-in reader said."""

    name: str
    verdict: str
    linuxcnc: str
    builtin: str


def installed_programs() -> list[Path]:
    """The sample programs of the Debian package, in order."""
    listing = subprocess.run(["dpkg", "-L", PACKAGE], capture_output=True, text=True, check=False).stdout
    return [path for path in map(Path, listing.splitlines()) if path.suffix in SUFFIXES and path.is_file()]


def programs_of(arguments: Iterable[str]) -> Iterator[Path]:
    """Files as named, and those in folders."""
    for argument in map(Path, arguments):
        inside = (p for p in argument.rglob("*") if p.suffix in SUFFIXES and p.is_file())  # a link may lead nowhere
        yield from sorted(inside) if argument.is_dir() else [argument]


def feed_path(program: ReadProgram) -> Moves:
    """Its cutting moves, less those that vanish in rs274's digits."""
    moves = program.moves
    length = np.abs(in_mm(moves.end) - in_mm(moves.start)).max(axis=1)
    return moves.take((moves.motion != RAPID) & ((length > PRINTED) | (moves.arc_sweep != 0.0)))


def in_mm(poses: np.ndarray) -> np.ndarray:
    """Poses (n, 6) in mm and degrees."""
    return np.column_stack([poses[:, :3] * 1e3, np.rad2deg(poses[:, 3:])])


def move_by_move(one: Moves, two: Moves) -> float:
    """Largest difference of ends and arcs, mm or degrees; infinite where the moves do not correspond."""
    if len(one) != len(two) or ((one.arc_sweep != 0.0) != (two.arc_sweep != 0.0)).any():
        return np.inf
    radius = np.linalg.norm(one.start[:, :3] - one.arc_center, axis=1) * (one.arc_sweep != 0.0)
    if (np.abs(one.arc_sweep - two.arc_sweep) > 1.0).any() or (np.abs(one.arc_normal - two.arc_normal) > 1e-3).any():
        return np.inf
    differences = [
        in_mm(one.start) - in_mm(two.start),
        in_mm(one.end) - in_mm(two.end),
        (one.arc_sweep - two.arc_sweep) * radius * 1e3,
    ]
    return max(float(np.abs(d).max(initial=0.0)) for d in differences)


def polyline(moves: Moves) -> np.ndarray:
    """Segments (n, 2, 6) along the moves, mm and degrees, fine enough for the tolerance."""
    lengths = np.linalg.norm(moves.end[:, :3] - moves.start[:, :3], axis=1)
    samples = sample_moves(moves, step=float(np.clip(lengths.sum() / 20_000, 1e-4, 5e-4)))
    points = in_mm(np.column_stack([samples.position, samples.abc]))
    within = samples.move[1:] == samples.move[:-1]
    return np.stack([points[:-1], points[1:]], axis=1)[within]


def farthest(one: np.ndarray, two: np.ndarray) -> float:
    """How far the ends of the segments of one path are from the other, at most.

    A few segments near each point bound its distance; the points of the largest bounds are held against all segments,
    until no bound is larger than the distance found.
    """
    points = one.reshape(-1, 6)[:: max(1, len(one) // 5000)]
    start, along = two[:, 0].T, (two[:, 1] - two[:, 0]).T
    near = cKDTree((start + along / 2).T).query(points, k=range(1, 1 + min(8, len(two))))[1]
    bound = _apart(points, start[:, near], along[:, near]).min(axis=1)
    order, worst = np.argsort(-bound, kind="stable"), 0.0
    for some in np.array_split(order, -(-len(points) * len(two) // AT_ONCE)):
        if len(some) and bound[some[0]] > worst:
            worst = max(worst, float(_apart(points[some], start, along).min(axis=1).max()))
    return worst


def _apart(points: np.ndarray, start: np.ndarray, along: np.ndarray) -> np.ndarray:
    """How far points (m, 6) are from segments (6, n), or each from its own (6, m, n): the largest of six, (m, n)."""
    squared = np.maximum((along**2).sum(axis=0), 1e-30)
    offsets = [points[:, [k]] - start[k] for k in range(6)]
    share = np.clip(sum(offset * along[k] for k, offset in enumerate(offsets)) / squared, 0.0, 1.0)
    apart = np.zeros_like(share)
    for k, offset in enumerate(offsets):
        np.maximum(apart, np.abs(share * along[k] - offset), out=apart)
    return apart


def difference(one: ReadProgram, two: ReadProgram) -> float:
    """How far two feed paths are apart, mm or degrees, in both directions."""
    first, second = feed_path(one), feed_path(two)
    if not len(first) or not len(second):
        return 0.0 if len(first) == len(second) else np.inf
    apart = move_by_move(first, second)
    if apart <= TOLERANCE:
        return apart
    there, back = polyline(first), polyline(second)
    return max(farthest(there, back), farthest(back, there))


def held_against(file: Path, control: Controller, rs274: str | None = None) -> Row:
    """Read one program by both."""
    theirs, heard = read(file, control, "linuxcnc", rs274)
    ours, answer = read(file, control, "builtin", rs274)
    verdict, detail = judged(file.name, theirs, heard, ours, answer)
    name = f"{file.parent.name}/{file.name}"
    return Row(name, verdict, *(words.removeprefix(f"{file.name}:") for words in (heard, detail)))


def judged(name: str, theirs: ReadProgram | None, heard: str, ours: ReadProgram | None, answer: str) -> tuple[str, str]:
    """The verdict on a file, and what is to be said of the built-in reader."""
    if ours is not None and theirs is not None:
        apart = difference(ours, theirs)
        return SAME if apart <= TOLERANCE else OTHER, f"{len(feed_path(ours))} moves, {apart:.4f} apart"
    if ours is None and answer != NONE:
        return REFUSED if answer.startswith(f"{name}:") else OTHER, answer
    if ours is None and heard == NONE:
        return NONE, answer
    # One has a path; without one the other must have refused, not run to the end.
    return OTHER if theirs is not None or heard == NONE else UNCHECKED, answer


def read(file: Path, control: Controller, interpreter: str, rs274: str | None) -> tuple[ReadProgram | None, str]:
    """The program, or why not; no cutting move is told apart, since it is an answer of its own."""
    try:
        program = read_program(file, interpreter=interpreter, rs274=rs274, controller=control)
        return (program, "read") if len(feed_path(program)) else (None, NONE)
    except InputError as error:
        return None, NONE if error.found == "no cutting move" else str(error)
    except TpsError as error:
        return None, str(error)


def page(rows: list[Row]) -> str:
    """The document."""
    ran = [row for row in rows if row.linuxcnc in ("read", NONE)]
    counts = Counter(row.verdict for row in ran)
    cells = ((row.name, row.verdict, cell(row.linuxcnc), cell(row.builtin)) for row in rows)
    return "\n".join([
        "# Conformance with LinuxCNC's interpreter", "",
        f"{len(rows)} programs, of which `rs274` runs {len(ran)} to the end: "
        f"{counts[SAME]} same feed path, {counts[NONE]} without a feed path for both, {counts[REFUSED]} refused by the "
        f"built-in reader, {counts[OTHER]} with another path. Within {TOLERANCE} mm and degrees, in both directions.",
        "*Not checked*: LinuxCNC's interpreter refuses what the built-in reader takes (user M codes, which that lists "
        "with a warning).", "", *table("program | verdict | LinuxCNC's interpreter | built-in reader", cells),
    ])  # fmt: skip


def cell(text: str) -> str:
    """Text for a cell: one line, not too long, no bars."""
    text = " ".join(text.replace("|", "/").split())
    return text if len(text) <= 110 else f"{text[:107]}..."


def measure(files: Iterable[Path], folder: Path, rs274: str | None = None) -> list[Row]:
    """Hold every file against LinuxCNC's interpreter; the tool table is written into `folder`."""
    tools = folder / "tools.csv"
    tools.write_text(TOOL_TABLE, encoding="utf-8")
    control = replace(LINUXCNC, tools=read_tool_table(tools))
    return [held_against(file, control, rs274) for file in files]


def main() -> int:
    """Print the table; the exit code is 1 if a path differs."""
    parser = page_parser("benchmarks.conformance", __doc__)
    parser.add_argument("programs", nargs="*", metavar="FILE|FOLDER", help="default: those of Debian's linuxcnc-uspace")
    parser.add_argument("--rs274", metavar="PATH", help="LinuxCNC's interpreter, if it is not on PATH")
    args = parser.parse_args()
    files = list(programs_of(args.programs)) if args.programs else installed_programs()
    if not files:
        parser.error(f"no programs; install {PACKAGE}, or name files")
    with tempfile.TemporaryDirectory() as folder:
        rows = measure(files, Path(folder), args.rs274)
    command = f"python -m benchmarks.conformance {' '.join(args.programs)}".rstrip()
    return tell(page(rows), args, command, all(row.verdict != OTHER for row in rows))


if __name__ == "__main__":
    sys.exit(main())
