"""What every command makes of the packaged programs, machines and data: stored, and held against an earlier store.

`frozen.py make FOLDER [PATTERN]` runs the commands (whose names the pattern matches) and keeps files and terminal text
below FOLDER; `frozen.py compare BEFORE AFTER` prints what differs, byte by byte, and exits 1 where anything does.
"""

from __future__ import annotations

import contextlib
import filecmp
import io
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[1]
DATA = Path("machines")  # a link beside `programs`
MACHINES = ("nist", "genhexkins", "nategh_agheli")
LARGE = ("surface_50000.nc",)  # with Parquet left out and no pictures: 50,000 lines
BOUNDS = ["--x", "-300:300", "--y", "-300:300", "--z", "400:1250"]
EXERCISES = {"one": "9006", "none": "7", "unknown": "31", "two": "12"}  # what is hidden -> seed
PASSING = re.compile(r"\d+(\.\d+)? ?(s|ms|us) |in \d+ s|[\d.]+ times the plain")  # times that a command prints


def commands() -> Iterator[tuple[str, list[str]]]:
    """Name of the folder, words of the command; {out} is that folder."""
    out = ["--out", "{out}/files"]
    for program in sorted((ROOT / "programs").glob("*.*")):
        if program.suffix not in (".nc", ".apt"):
            continue
        name, words = program.stem, [f"programs/{program.name}"]
        words += ["--controller", f"programs/{name}.toml"] if program.with_suffix(".toml").exists() else []
        words += ["--tools", "programs/tools.tbl"] if name == "three_tools" else []
        plain = ["--no-plots"] if program.name in LARGE else []
        yield f"check_{name}", ["check", *words]
        yield f"check_json_{name}", ["check", *words, "--json"]
        yield f"analyze_{name}", ["analyze", *words, *out, *plain, "--partial"]
        yield f"path_{name}", ["path", *words, "--step", "5"]
    for machine in MACHINES:
        yield f"machine_{machine}", ["machine", "show", machine]
        yield f"machine_json_{machine}", ["machine", "show", machine, "--json"]
        yield (
            f"machine_check_{machine}",
            ["machine", "check", str(DATA / f"{machine}.toml"), "--out", "{out}/check.png"],
        )
        yield (
            f"analyze_on_{machine}",
            ["analyze", "programs/pocket.nc", "--machine", machine, *out, "--partial", "--json"],
        )
        yield f"pose_{machine}", ["pose", "100", "-200", "800", "10", "-15", "20", "--machine", machine, "--json"]
    yield "analyze_options", ["analyze", "programs/pocket.nc", "--load", "softest", "--origin", "-100,50,700,0,0,30",
                              "--require", "40000", "--compare", "genhexkins", "--step", "3", *out]  # fmt: skip
    yield "analyze_folder", ["analyze", "programs", "--no-plots", "--jobs", "1", *out]
    yield "map", ["map", "--z", "600", *out]
    yield "place", ["place", "programs/pocket.nc", *BOUNDS, *out]
    yield "place_write", ["place", "programs/pocket.nc", "--rotate", "0", *BOUNDS, *out, "--write", "{out}/placed.nc"]
    yield "case_study", ["case-study", *out]
    yield "effects_list", ["effects", "list"]
    yield "effects_list_json", ["effects", "list", "--json"]
    yield "effects_new", ["effects", "new", "{out}/mine.py"]
    yield "effects_check", ["effects", "check", "{out}/../effects_new/mine.py"]
    for command, more in (("compare", []), ("diagnose", []), ("update", ["--add", "joint_compliance"]), ("plan", [])):
        yield f"{command}_paper", [command, "nist-table1", *more, *out]
        yield f"{command}_paper_json", [command, "nist-table1", *more, *out, "--json"]
    for hidden, seed in EXERCISES.items():
        folder = f"{{out}}/../rig_{hidden}/exercise"
        yield f"rig_{hidden}", ["rig", "new", "--seed", seed, "--hidden", hidden, "--out", "{out}/exercise"]
        for command in ("compare", "diagnose", "plan"):
            machine = ["--machine", f"{folder}/machine.toml"]
            yield f"{command}_{hidden}", [command, f"{folder}/measurements.csv", *machine, *out]
    exercise = "{out}/../rig_one/exercise"
    words = [f"{exercise}/measurements.csv", "--machine", f"{exercise}/machine.toml", "--add", "weak_strut"]
    yield "update_one", ["update", *words, "-o", "{out}/better.toml", *out]
    for command in ("analyze", "path", "check", "pose", "map", "machine", "place", "case-study", "effects", "reduce",
                    "compare", "diagnose", "update", "plan", "rig", "studio"):  # fmt: skip
        yield f"help_{command}", [command, "--help"]


def make(folder: Path, chosen: str) -> None:
    """Run every command whose name the pattern matches, in this process; terminal text stands in `said.txt`."""
    folder.mkdir(parents=True)
    os.chdir(folder)  # the same words for whoever compares
    (folder / "programs").symlink_to(ROOT / "programs")
    (folder / DATA).symlink_to(ROOT / "toolpath_stiff" / "data" / "machines")
    os.environ.update(OPENBLAS_NUM_THREADS="1", COLUMNS="100")
    sys.path.insert(0, str(ROOT))
    from toolpath_stiff.cli.main import main as tps

    for name, words in commands():
        if not re.search(chosen, name):
            continue
        out = Path(name)
        out.mkdir()
        screen = io.StringIO()
        with contextlib.redirect_stdout(screen), contextlib.redirect_stderr(screen):
            code = tps([word.replace("{out}", str(out)) for word in words])
        text = PASSING.sub("TIME ", screen.getvalue())
        (out / "said.txt").write_text(f"{text}exit code {code}\n", "utf-8")
        print(name, code, flush=True)
    (folder / "programs").unlink()
    (folder / DATA).unlink()


def differences(before: Path, after: Path) -> Iterator[str]:
    """Files that only one side has, or that differ, with the first line that does."""
    made = {folder.name for folder in after.iterdir()}  # of what was made anew
    sides = [
        {path.relative_to(side) for name in made for path in (side / name).rglob("*") if path.is_file()}
        for side in (before, after)
    ]
    yield from (f"only {'after' if path in sides[1] else 'before'}: {path}" for path in sorted(sides[0] ^ sides[1]))
    for path in sorted(sides[0] & sides[1]):
        old, new = before / path, after / path
        if filecmp.cmp(old, new, shallow=False):
            continue
        texts = [old.read_bytes(), new.read_bytes()]
        lines = [text.splitlines() for text in texts]
        first = next(
            (i for i, pair in enumerate(zip(*lines, strict=False)) if pair[0] != pair[1]), min(map(len, lines))
        )
        shown = [side[first][:160] if first < len(side) else b"(end)" for side in lines]
        yield f"{path}:{first + 1}: {shown[0]!r} -> {shown[1]!r}"


def main() -> int:
    """Make or compare."""
    match sys.argv[1:]:
        case ["make", folder, *chosen]:
            make(Path(folder).resolve(), *(chosen or ["."]))
            return 0
        case ["compare", before, after]:
            rows = list(differences(Path(before).resolve(), Path(after).resolve()))
            print("\n".join(rows) or "nothing differs")
            return bool(rows)
    print(__doc__)
    return 2


if __name__ == "__main__":
    sys.exit(main())
