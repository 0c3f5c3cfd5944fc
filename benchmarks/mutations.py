"""`python -m benchmarks.mutations`: inputs of every kind with bytes dropped, doubled, swapped and replaced.

Each mutated input must either be read or be refused, with its line where it has one: no traceback, no hang, no growth
of memory. Exit code 1 if one is not. The kinds: NC programs in every dialect, cutter-location files, machine files,
controller files, tool tables, offsets, files of HAL pins, measurements, raw records, plans, poses, workbooks, files
with effects, the manifest of a folder of results, the words of the command line. Seeded.
"""

import argparse
import io
import os
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from importlib import resources
from pathlib import Path
from types import FrameType

from benchmarks.pages import mark, page_parser, table, tell
from toolpath_stiff.api.effects import effect_template
from toolpath_stiff.api.machine_files import machine_from_linuxcnc, machine_template
from toolpath_stiff.api.poses import read_poses
from toolpath_stiff.cli.main import main as tps
from toolpath_stiff.errors import EffectFault, InputError, InputErrors
from toolpath_stiff.machine.file import load_machine
from toolpath_stiff.nc.controller import DIALECTS, Controller, read_controller
from toolpath_stiff.nc.reader import parse_program
from toolpath_stiff.nc.tables import read_offsets, read_tool_table
from toolpath_stiff.readings.measurements import read_measurements
from toolpath_stiff.readings.raw import reduce
from toolpath_stiff.results_folder import check_folder
from toolpath_stiff.rig.exercise import read_plan
from toolpath_stiff.rig.nominal import load_nominal
from toolpath_stiff.stiffness.catalogue import effects_from_file

PROGRAMS = Path(__file__).parent.parent / "programs"
LINES = (30, 90)  # of the openings that are mutated: the later part is met as well
MOST_MUTATIONS = 6
PATIENCE = 5  # s for one input
SETTLED = 0.1  # share of the inputs after which memory is compared: caches are full then
GROWTH_BAR = 32.0  # MB between then and the end
WRONG = ("traceback", "hang", "no line")
# What concerns the whole input has no line of its own.
OF_THE_WHOLE = (
    "no cutting move", "empty", "not a text file", "is missing", "no poses", "does not record what tps wrote",
    "Excel", "defines no effect", "is there already", "was changed since", "holds the results of", "unpacked",
    "= missing", "has no six joints", "cannot read", "not known (no ini file", "no pins",
)  # fmt: skip
# Bytes that mean something somewhere, and what no file should hold.
ODD = ["0", "-", ".", "1e999", "nan", "9" * 400, '"', "'", "[", "]", "{", ",", ";", "=", "\n", "\r", "\t", "\x00",
       "\x1b[2J", "²", "µ", "\ufeff", "\udcff", "(", ")", "#", "%", "A" * 300, "=1+1", "[" * 90, "a." * 90]  # fmt: skip


class Hang(BaseException):
    """An input took too long; not an `Exception`, so that no reader swallows it."""


def _alarm(number: int, frame: FrameType | None) -> None:
    raise Hang


@dataclass(frozen=True)
class Kind:
    """A kind of input: what is mutated, what reads it (bytes and their number), whether a refusal names its line."""

    name: str
    originals: tuple[bytes, ...]
    read: Callable[[bytes, int], object]
    lines: bool = True


def _program(suffix: str) -> Callable[[bytes, int], object]:
    tools, dialects = read_tool_table(PROGRAMS / "tools.tbl"), sorted(DIALECTS)

    def read(content: bytes, number: int) -> object:
        control = Controller(DIALECTS[dialects[number % len(dialects)]], tools=tools)
        return parse_program(content.decode("latin-1"), f"part{suffix}", controller=control)

    return read


def _file(name: str, read: Callable[[str], object]) -> Callable[[bytes, int], object]:
    """A reader of files: the bytes stand in one, in the current folder."""

    def from_file(content: bytes, number: int) -> object:
        Path(name).write_bytes(content)
        return read(name)

    return from_file


def _effects(content: bytes, number: int) -> object:
    Path(f"mutated_{number}.py").write_bytes(content)  # by its own name: modules are kept
    try:
        return effects_from_file(f"mutated_{number}.py")
    finally:
        sys.modules.pop(f"toolpath_stiff_user_effects_mutated_{number}", None)
        Path(f"mutated_{number}.py").unlink()


def _command(content: bytes, number: int) -> object:
    """The command line; its exit code must be one that is known, and an unforeseen error is none."""
    words = [os.fsdecode(word) for word in content.replace(b"\x00", b"").split(b"\n")]
    out, error = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(error):
        code = tps(words)
    if code not in (0, 1, 2, 3) or "report this line" in error.getvalue():
        raise AssertionError(f"exit code {code} of {words}: {error.getvalue()[:300]}")
    if code == 2 and not error.getvalue() and not out.getvalue():
        raise AssertionError(f"not a word about {words}")
    return code


def _openings(suffix: str) -> tuple[bytes, ...]:
    """Openings of the programs; circles and cycles come late in a cutter-location file."""
    found = []
    for path in sorted(PROGRAMS.glob(f"*{suffix}")):
        lines = path.read_bytes().splitlines(keepends=True)
        pieces = [lines[:count] for count in LINES] if suffix == ".nc" else [lines[:30], lines[-45:], lines]
        found += [b"".join(piece) for piece in pieces]
    return tuple(found)


CONTROLLER = b"""dialect = "fanuc"
block_delete = [2, 3]
setup = "riser"
[offsets]
G54 = [100, 0, -20.5, 0, 0, 90]
"G54.1 P3" = [1, 2, 3]
[[tools]]
number = 3
length_mm = 80.5
diameter_mm = 6.0
remark = "ball nose"
"""
OFFSETS = b"G54 = [100, -50, 800]\nG55 = [1, 2, 3, 0, 0, 90, 12.5]\nG54.1 P2 = [1]\nG28 = [0, 0, 900]\n"
PARAMETERS = b"5161\t0.0\n5221\t100.0\n5222\t-50.5\n5223\t800\n5230\t15\n5241\t1\n"
TOOLS = b'tool,length_mm,diameter_mm,remark\n1,50,6,end mill\n2,80.5,,"drill, long"\n'
MEASURED = b"""point,setup,clamp,repeat,x_mm,y_mm,z_mm,dx,dy,dz,force_N,stiffness_N_per_mm,sd_N_per_mm
1,riser,1,1,0,0,800,1,0,0,1000,35000,700
1,riser,1,2,0,0,800,0,1,0,1000,36000.5,700
2,,2,1,100,-50,700,0,0,1,500,91000,900
3,,3,1,-100,50,900,1,1,0,500,34000,700
"""
RAW = b"""point,x_mm,y_mm,z_mm,direction,jog_um,force_N,displacement_um
a,0,0,900,X,0,0,0
a,0,0,900,X,200,1000,20
a,0,0,900,X,-200,-1000,-20
a,0,0,900,X,0,0,0
b,0,0,800,Y,0,0,0
b,0,0,800,Y,200,1000,25
b,0,0,800,Y,-200,-1000,-25
"""
PLAN = b"""x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,direction,force_N,clamp,setup,stiffness_N_per_mm
0,0,900,0,0,0,X,1000,1,riser,
10,20,850,5,0,-5,Z,500,2,,
"""
POSES = b"x_mm,y_mm,z_mm,a_deg,b_deg,c_deg\n0,0,800,0,0,0\n-100,50,900,5,5,10\n"
WORDS = (
    b"pose\n0\n-100\n800\n--load\nnormal\n--force\n500", b"pose\n10\n-20\n800\n5\n-5\n10\n--machine\nnist\n--json",
    b"check\npart.nc\n--dialect\nfanuc\n--block-delete\n2,3", b"path\npart.nc\n--step\n5\n--origin\n1,2,3",
    b"effects\nshow\nweak_strut", b"machine\nlist\n--json", b"machine\nshow\nnist\n--json",
)  # fmt: skip
DRAWS = b"machine\nshow\nnist"


def _workbook() -> bytes:
    import openpyxl

    book, stream = openpyxl.Workbook(), io.BytesIO()
    for row in MEASURED.decode().splitlines():
        book.active.append([float(cell) if cell.replace(".", "").isdigit() else cell for cell in row.split(",")])
    book.save(stream)
    return stream.getvalue()


@cache
def kinds() -> tuple[Kind, ...]:
    """All of them."""
    nist, nominal = load_machine("nist"), load_nominal("nist")
    machines = tuple(
        path.read_bytes() for path in sorted((resources.files("toolpath_stiff") / "data" / "machines").iterdir())
    )  # type: ignore[attr-defined]
    table, dome, hal = ((PROGRAMS / name).read_bytes() for name in ("tools.tbl", "dome_ac_table.toml", "hexapod.hal"))
    manifest = b'{\n "written_by": "tps analyze",\n "results_of": ["part.nc"],\n "sha256": {\n  "a.csv": "00"\n }\n}\n'
    measurements = _file("data.csv", lambda name: read_measurements(name, nist))
    return (
        Kind("NC programs", _openings(".nc"), _program(".nc")),
        Kind("cutter-location files", _openings(".apt"), _program(".apt")),
        Kind("machine files", (*machines, machine_template("mine.toml").text.encode()), _file("m.toml", load_machine)),
        Kind("machine files of the rig", machines, _file("m.toml", load_nominal)),
        Kind("controller files", (CONTROLLER, dome), _file("c.toml", read_controller)),
        Kind("tool tables", (table, TOOLS), _file("t.tbl", read_tool_table)),
        Kind("offsets", (OFFSETS, PARAMETERS), _file("o.txt", read_offsets)),
        Kind("files of HAL pins", (hal,), _file("k.hal", lambda name: machine_from_linuxcnc(name, "mm")), lines=False),
        Kind("measurements", (MEASURED,), measurements),
        Kind("raw records", (RAW,), _file("raw.csv", reduce)),
        Kind("plans", (PLAN,), _file("plan.csv", lambda name: read_plan(name, nominal))),
        Kind("poses", (POSES,), _file("poses.csv", read_poses)),
        Kind("workbooks", (_workbook(),), measurements, lines=False),
        Kind("files with effects", (effect_template("mine").text.encode(),), _effects),
        Kind("manifests", (manifest,), _file(".tps-files.json", lambda name: check_folder(".", ["b.csv"]))),
        Kind("words of the command line", WORDS, _command, lines=False),
    )


def mutated(original: bytes, chance: random.Random) -> bytes:
    """The original with one to six bytes dropped, doubled, swapped, or something odd put among them."""
    content = bytearray(original)
    for _ in range(chance.randint(1, MOST_MUTATIONS)):
        at = chance.randrange(len(content))
        kind = chance.randrange(5)
        if kind == 0 and len(content) > 1:
            del content[at]
        elif kind == 1:
            content.insert(at, content[at])
        elif kind == 2:
            other = chance.randrange(len(content))
            content[at], content[other] = content[other], content[at]
        elif kind == 3:
            content[at:at] = chance.choice(ODD).encode("utf-8", "surrogateescape")
        else:
            end = at + chance.randrange(40)
            content[at:end] = b"" if len(content) > end - at else b"0"
    return bytes(content)


def outcome(kind: Kind, content: bytes, number: int) -> str:
    """`read`, `refused`, or what went wrong."""
    signal.setitimer(signal.ITIMER_PROF, PATIENCE)  # of its own time, however busy the machine is
    try:
        kind.read(content, number)
    except InputErrors as found:
        return _refused(kind, found.errors)
    except (InputError, EffectFault) as error:
        return _refused(kind, [error])
    except Hang:
        return f"hang: {content[:300]!r}"
    except Exception as error:
        return f"traceback: {type(error).__name__}: {str(error)[:300]}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return "read"


def _refused(kind: Kind, errors: object) -> str:
    for error in errors:  # type: ignore[attr-defined]
        if kind.lines and error.line is None and not any(words in str(error) for words in OF_THE_WHOLE):
            return f"no line: {error}"[:300]
    return "refused"


@contextmanager
def scene() -> Iterator[None]:
    """A current folder with what the command lines name, an alarm clock, and no colours."""
    before, alarm = Path.cwd(), signal.signal(signal.SIGPROF, _alarm)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        Path("tools.tbl").write_bytes((PROGRAMS / "tools.tbl").read_bytes())
        Path("part.nc").write_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nM2\n")
        try:
            yield
        finally:
            os.chdir(before)
            signal.signal(signal.SIGPROF, alarm)


def megabytes() -> float:
    """Largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> int:
    """Mutate, read, count, print."""
    parser = page_parser("benchmarks.mutations", __doc__)
    parser.add_argument("--n", type=int, default=200_000, metavar="N", help="inputs (default: 200000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N")
    args = parser.parse_args()
    chance, counts = random.Random(args.seed), {kind.name: Counter[str]() for kind in kinds()}
    wrong, slowest, settled = [], 0.0, 0.0
    with scene():
        for kind in kinds():  # whatever is imported or drawn for the first time
            for original in kind.originals:
                outcome(kind, original, 0)
        _command(DRAWS, 0)  # what draws is loaded once, whenever a word that kept a command from it is lost
        for number in range(args.n):
            kind = kinds()[number % len(kinds())]
            content = mutated(chance.choice(kind.originals), chance)
            begin = time.process_time()
            found = outcome(kind, content, number)
            slowest = max(slowest, time.process_time() - begin)
            counts[kind.name][found.split(":")[0]] += 1
            if found not in ("read", "refused"):
                wrong.append(f"{kind.name}, input {number}: {found}")
            if number == int(SETTLED * args.n):
                settled = megabytes()
    growth = megabytes() - settled
    text = page(args, counts, growth, slowest)
    print(*wrong[:40], sep="\n", file=sys.stderr)
    command = f"python -m benchmarks.mutations --n {args.n} --seed {args.seed}"
    return tell(text, args, command, not wrong and growth <= GROWTH_BAR)


def page(args: argparse.Namespace, counts: dict[str, Counter[str]], growth: float, slowest: float) -> str:
    """The document."""
    rows = []
    for name, of in counts.items():
        wrong = [of[kind] for kind in WRONG]
        rows.append((name, of.total(), of["read"], of["refused"], *wrong, mark(not any(wrong))))
    cost = [
        ("memory grown by", f"{growth:.1f} MB", f"{GROWTH_BAR:g} MB", mark(growth <= GROWTH_BAR)),
        ("slowest input", f"{slowest:.1f} s of CPU", f"{PATIENCE} s", mark(slowest <= PATIENCE)),
    ]
    heading = f"kind | inputs: | read: | refused: | {' | '.join(f'{kind}:' for kind in WRONG)} | "
    head = ["# Mutated inputs", "", f"{args.n} inputs, seed {args.seed}: each is read, or refused with its line.", ""]
    return "\n".join([*head, *table(heading, rows), "", *table(" | found: | bar: | ", cost), ""])


if __name__ == "__main__":
    raise SystemExit(main())
