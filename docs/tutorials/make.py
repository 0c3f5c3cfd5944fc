"""Runs the tutorials: brings the outputs that they show and their pictures up to date, or checks them.

    python docs/tutorials/make.py            rewrites outputs and pictures
    python docs/tutorials/make.py --check    only says what differs; exit code 1 if anything does

A block ```console holds commands (`$ tps ...`, or `$ cat FILE`) and what they print. A line `...` stands for lines left
out. The commands of one tutorial run in the order of its text, in one folder that is empty but for `programs/`.
"""

from __future__ import annotations

import contextlib
import difflib
import io
import os
import re
import shlex
import sys
import tempfile
from collections.abc import Iterator
from decimal import Decimal
from pathlib import Path

HERE = Path(__file__).resolve().parent
TUTORIALS = sorted(HERE.glob("[0-9]*.md"))
ELLIPSIS = "..."
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
BLOCK = re.compile(r"```console\n(.*?)```", re.DOTALL)
DRAWS = ("analyze", "compare", "diagnose", "forces", "plan", "update")  # commands that know --no-plots
WIDTH, COLOURS = 1000, 255  # pixels and palette of a committed picture: below 150 kB each

# Picture in pictures/ -> the tutorial, the file in its folder, and how much of it is shown, from the top.
PICTURES = {
    "1_variables.png": ("1_named_at_once.md", "ex1/compare/variables.png", 1.0),
    "1_ladder.png": ("1_named_at_once.md", "ex1/diagnose/ladder.png", 1.0),
    "1_before_after.png": ("1_named_at_once.md", "ex1/update/before_after.png", 1.0),
    "2_ladder.png": ("2_after_a_plan.md", "ex2/first/ladder.png", 1.0),
    "2_plan.png": ("2_after_a_plan.md", "ex2/plan/plan.png", 1.0),
    "2_ladder_again.png": ("2_after_a_plan.md", "ex2/second/ladder.png", 1.0),
    "3_portrait.png": ("3_outside_the_catalogue.md", "ex3/first/portrait.png", 1.0),
    "3_before_after.png": ("3_outside_the_catalogue.md", "ex3/update/before_after.png", 1.0),
    "4_machine.png": ("4_a_robot_cell.md", "cell/machine.png", 1.0),
    "4_path.png": ("4_a_robot_cell.md", "cell/placed/path.png", 1.0),
    "5_part.png": ("5_micrometres.md", "shop/analyze/cut.png", 1.0),
    "5_forces.png": ("5_micrometres.md", "shop/forces/forces.png", 1.0),
}


@contextlib.contextmanager
def workshop() -> Iterator[Path]:
    """The folder in which a tutorial is run, made the current one."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "programs").symlink_to(HERE.parent.parent / "programs")
        os.chdir(folder)
        try:
            yield folder
        finally:
            os.chdir(before)


def commands(block: str) -> list[tuple[str, list[str]]]:
    """Commands of a block, each with the lines shown below it."""
    found: list[tuple[str, list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


def printed(command: str, pictures: bool) -> list[str]:
    """Run one command of the text here and now; lines that it prints."""
    from toolpath_stiff.cli.main import main

    arguments = shlex.split(command)
    if arguments[0] == "cat":
        return [line.rstrip() for line in Path(arguments[1]).read_text(encoding="utf-8").splitlines()]
    if arguments[0] != "tps":
        raise ValueError(f"{command}: the tutorials run tps and cat only")
    if not pictures and arguments[1] in DRAWS:
        arguments.append("--no-plots")
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        code = main(arguments[1:])
    if code != 0:
        raise RuntimeError(f"{command}: exit code {code}")
    return [line.rstrip() for line in output.getvalue().splitlines()]


def alike(shown: str, line: str) -> bool:
    """Whether two lines have the same words, and numbers that differ by one in the last place at most.

    Last digits depend on the processor's arithmetic.
    """
    if NUMBER.sub("#", shown) != NUMBER.sub("#", line):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(line), strict=True)
    return all(abs(Decimal(one) - Decimal(other)) <= _last_place(one) for one, other in pairs)


def _last_place(number: str) -> Decimal:
    exponent = Decimal(number).as_tuple().exponent
    return Decimal(1).scaleb(exponent) if isinstance(exponent, int) else Decimal(0)


def agrees(shown: list[str], lines: list[str]) -> bool:
    """Whether these lines are what is shown, an ellipsis standing for any number of lines."""
    if not shown:
        return True
    pieces: list[list[str]] = [[]]
    for line in shown:
        if line == ELLIPSIS:
            pieces.append([])
        else:
            pieces[-1].append(line)

    def stands_at(place: int, piece: list[str]) -> bool:
        own = lines[place : place + len(piece)]
        return len(own) == len(piece) and all(alike(one, other) for one, other in zip(piece, own, strict=True))

    if len(pieces) == 1:
        return len(shown) == len(lines) and stands_at(0, shown)
    place, end = len(pieces[0]), len(lines) - len(pieces[-1])
    if not stands_at(0, pieces[0]) or end < place or not stands_at(end, pieces[-1]):
        return False
    for piece in pieces[1:-1]:
        found = next((at for at in range(place, end - len(piece) + 1) if stands_at(at, piece)), None)
        if found is None:
            return False
        place = found + len(piece)
    return True


def renewed(shown: list[str], lines: list[str]) -> list[str]:
    """What to show now: the lines, in order, that together are most like those shown in their letters."""
    if ELLIPSIS not in shown:
        return lines if shown else []
    letters = [re.sub(r"[^a-zA-Z]", "", line) for line in lines]
    wanted = [re.sub(r"[^a-zA-Z]", "", line) for line in shown if line != ELLIPSIS]
    if len(wanted) > len(lines):
        raise ValueError(f"fewer lines are printed than shown, {shown[0]!r} and so on: edit the text by hand")
    # best[i][j]: the likeness of the first i lines shown, all of them found among the first j printed.
    best = [[0.0] * (len(lines) + 1)] + [[float("-inf")] * (len(lines) + 1) for _ in wanted]
    for i, own in enumerate(wanted):
        for j, other in enumerate(letters):
            alike_here = difflib.SequenceMatcher(None, own, other).ratio()
            best[i + 1][j + 1] = max(best[i + 1][j], best[i][j] + alike_here)
    place, chosen = len(lines), list[int]()
    for i in range(len(wanted), 0, -1):
        while best[i][place] == best[i][place - 1]:
            place -= 1
        place -= 1
        chosen.append(place)
    now, place = list[str](), 0
    for line in shown:
        if line != ELLIPSIS:
            left_out = bool(chosen[-1] != place and now[-1:] != [ELLIPSIS])
            place = chosen.pop() + 1
            now += [*[ELLIPSIS] * left_out, lines[place - 1]]
        else:
            now.append(line)
    return [*now, *[ELLIPSIS] * (place < len(lines) and now[-1] != ELLIPSIS)]


def play(tutorial: Path, pictures: bool) -> Iterator[tuple[str, list[str], list[str]]]:
    """Commands of a tutorial, in the current folder: command, lines shown, lines printed."""
    for block in BLOCK.finditer(tutorial.read_text(encoding="utf-8")):
        for command, shown in commands(block.group(1)):
            yield command, shown, printed(command, pictures)


def shrink(source: Path, target: Path, share: float) -> None:
    """A picture small enough to be kept: its upper share, narrower, with a palette."""
    from PIL import Image

    picture = Image.open(source).convert("RGB")
    picture = picture.crop((0, 0, picture.width, round(share * picture.height)))
    if picture.width > WIDTH:
        picture = picture.resize((WIDTH, round(picture.height * WIDTH / picture.width)), Image.Resampling.LANCZOS)
    picture.quantize(COLOURS, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(target, optimize=True)


def remake(tutorial: Path) -> None:
    """Rewrite the outputs shown in a tutorial, and its pictures."""
    text = tutorial.read_text(encoding="utf-8")
    with workshop() as folder:
        for command, shown, lines in play(tutorial, pictures=True):
            if not agrees(shown, lines):
                old = "\n".join([f"$ {command}", *shown]) + "\n"
                text = text.replace(old, "\n".join([f"$ {command}", *renewed(shown, lines)]) + "\n")
                print(f"{tutorial.name}: {command}: output renewed")
        for name, (owner, file, share) in PICTURES.items():
            if owner == tutorial.name:
                shrink(folder / file, HERE / "pictures" / name, share)
    tutorial.write_text(text, encoding="utf-8")


def check(tutorial: Path) -> bool:
    """Whether all that a tutorial shows is printed; says what is not."""
    good = True
    with workshop():
        for command, shown, lines in play(tutorial, pictures=False):
            if not agrees(shown, lines):
                good = False
                print(f"{tutorial.name}: {command}: prints otherwise than shown", file=sys.stderr)
                print("\n".join(difflib.unified_diff(shown, lines, "shown", "printed", lineterm="")), file=sys.stderr)
    return good


if __name__ == "__main__":
    if "--check" in sys.argv[1:]:
        good = [check(tutorial) for tutorial in TUTORIALS]
        sys.exit(0 if all(good) else 1)
    for each in TUTORIALS:
        remake(each)
