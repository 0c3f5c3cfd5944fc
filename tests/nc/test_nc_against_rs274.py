"""Our moves against LinuxCNC's interpreter: random programs over every supported code."""

from __future__ import annotations

import math
import random
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from tests.nc import rs274
from toolpath_stiff.errors import TpsError
from toolpath_stiff.nc.moves import MOTION_NAMES, ReadProgram
from toolpath_stiff.nc.reader import read_program

pytestmark = pytest.mark.skipif(not rs274.AVAILABLE, reason="LinuxCNC's rs274 is not installed")

# rs274 prints four decimals of the active unit, of position, work offset, G92 and tool length each: half a unit
# in the last place of each, in inches.
TOLERANCE_MM = 4 * 0.5e-4 * 25.4
# LinuxCNC takes tool table lengths as inches in rs274, whatever the ini says; ours as mm.
TOOLS = {1: 50.0, 2: 75.5, 3: 101.6}
TABLE_RS274 = "".join(f"T{n} P{n} Z{z / 25.4:.8f} D0.25 ;\n" for n, z in TOOLS.items())
TABLE_OURS = "".join(f"T{n} P{n} Z{z} D6.35 ;\n" for n, z in TOOLS.items())


def assert_same_path(program: ReadProgram, canon: rs274.Canon) -> None:
    """Same kinds, ends, arc axes and senses, move by move; moves shorter than the printed digits are left out."""
    moves, origin = program.moves, np.array(program.origin[:3]) * 1e3
    start, end = (np.hstack([p[:, :3] * 1e3 + origin, np.rad2deg(p[:, 3:])]) for p in (moves.start, moves.end))
    mine = np.flatnonzero((moves.arc_sweep != 0.0) | (np.abs(end - start).max(axis=1) > 2 * TOLERANCE_MM))
    theirs = [m for m in canon.moves if m[3] is not None or np.abs(m[2] - m[1]).max() > 2 * TOLERANCE_MM]
    both = min(len(mine), len(theirs))
    kinds = np.array([{"cycle": "feed"}.get(name, name) for name in MOTION_NAMES])[moves.motion[mine]]
    their_kinds, their_ends = [m[0] for m in theirs], np.array([m[2] for m in theirs]).reshape(-1, 6)
    apart = np.abs(end[mine[:both]] - their_ends[:both]).max(axis=1)
    other_kind = kinds[:both] != np.array(their_kinds[:both], dtype=str)

    def where(i: int) -> str:
        row = mine[i]
        line = moves.line[row]
        return (
            f"line {line}: {program.source[line - 1]!r}\nours {kinds[i]} {start[row]} {end[row]} "
            f"{moves.arc_sweep[row]}\ntheirs {theirs[i]}"
        )

    wrong = other_kind | ~(apart <= TOLERANCE_MM)
    assert not wrong.any(), where(int(np.argmax(wrong)))
    for i in np.flatnonzero(moves.arc_sweep[mine[:both]]):
        row = mine[i]
        center, normal, sweep = moves.arc_center[row] * 1e3 + origin, moves.arc_normal[row], moves.arc_sweep[row]
        their_center, their_normal, turns = theirs[i][3]
        assert np.allclose(normal, their_normal, rtol=1e-7, atol=1e-6), where(i)
        off = center - their_center
        # A centre from R magnifies the printed digits where the chord is nearly a diameter.
        assert np.linalg.norm(off - (off @ normal) * normal) < 50 * TOLERANCE_MM, where(i)
        assert np.sign(sweep) == np.sign(turns), where(i)
        assert math.ceil(abs(sweep) / math.tau - 1e-6) == abs(turns), where(i)
    assert len(mine) == len(theirs)


class Writer:
    """Writes a random program that stays valid: it tracks just enough state for that."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.lines = ["G21 G17 G90 G94 F500", "G0 X1 Y2 Z30"]
        self.inch = False

    def number(self, low: float, high: float) -> str:
        value = self.random.uniform(low, high) / (25.4 if self.inch else 1.0)
        return self.random.choice([f"{value:.3f}", f"{value:+.4f}", f" {value:.2f}", f"{value:.1f}"])

    def axes(self, letters: str, low: float = -40, high: float = 40, least: int = 1) -> str:
        chosen = self.random.sample(letters, self.random.randint(least, len(letters)))
        return " ".join(
            f"{c}{self.random.uniform(-20, 20):.2f}" if c in "ABC" else f"{c}{self.number(low, high)}" for c in chosen
        )

    def arc(self) -> None:
        plane = self.random.choice(["G17", "G18", "G19"])
        first, second, normal = {"G17": "XYZ", "G18": "ZXY", "G19": "YZX"}[plane]
        words = {"X": "I", "Y": "J", "Z": "K"}
        code = self.random.choice(["G2", "G3"])
        radius = self.random.uniform(3, 20)
        angle, sweep = self.random.uniform(0, 6.28), self.random.uniform(0.3, 6.0)
        if self.random.random() < 0.2:
            sweep = 0.0  # a full circle
        u = 25.4 if self.inch else 1.0
        i, j = radius * math.cos(angle) / u, radius * math.sin(angle) / u
        sign = -1 if code == "G2" else 1
        end = angle + math.pi + sign * sweep
        dx, dy = i + radius * math.cos(end) / u, j + radius * math.sin(end) / u
        helix = f"{normal}{self.number(-5, 5)}" if self.random.random() < 0.4 else ""
        turns = f"P{self.random.randint(1, 3)}" if self.random.random() < 0.3 else ""
        if self.random.random() < 0.3 and 0.3 < sweep < 5.9:
            r = radius / u if sweep < math.pi else -radius / u
            words_of_center, turns = f"R{r:.6f}", ""
        else:
            words_of_center = f"{words[first]}{i:.6f} {words[second]}{j:.6f}"
        ends = "" if sweep == 0.0 else f"{first}{dx:.6f} {second}{dy:.6f}"
        self.lines += ["G91", f"{plane} {code} {ends} {helix} {words_of_center} {turns}", "G90 G17"]

    def cycle(self) -> None:
        r = self.random
        code = r.choice(["G81", "G82", "G83", "G73", "G85", "G89"])
        plane = r.choice(["G17", "G18", "G19"])
        first, second, normal = {"G17": "XYZ", "G18": "XZY", "G19": "YZX"}[plane]
        extra = f"P{r.uniform(0, 2):.1f}" if code in ("G82", "G89") else ""
        extra += f" Q{2.37 if not self.inch else 0.0937}" if code in ("G83", "G73") else ""
        # In G18 and G19 rs274 2.9 takes the level of Z for that of the plane's own normal (G98, and R under G91).
        back = r.choice(["G98", "G99"]) if plane == "G17" else "G99"
        repeat = r.choice(["", "", "L2"])
        if plane == "G17" and r.random() < 0.4:  # incremental: R up from here, Z down from R
            self.lines += [
                f"G91 {plane} {back} {code} {first}{self.number(1, 9)} {normal}{self.number(-9, -5)} "
                f"R{self.number(1, 4)} {extra} {repeat}",
                f"{second}{self.number(1, 9)}",
            ]
        else:
            self.lines += [
                f"{plane} {back} {code} {first}{self.number(1, 9)} {normal}{self.number(-9, -5)} "
                f"R{self.number(1, 40)} {extra} {repeat}",
                f"{first}{self.number(-9, 9)} {second}{self.number(1, 9)}",
            ]
        self.lines += ["G80", "G90 G17"]

    def statement(self) -> None:
        r = self.random
        kind = r.randrange(13)
        if kind <= 2:
            self.lines.append(f"{r.choice(['G0', 'G1', 'g01', 'G 1'])} {self.axes('XYZABC')}")
        elif kind <= 4:
            self.arc()
        elif kind <= 6:
            self.cycle()
        elif kind == 7:
            # The stand-alone rs274 does not carry a tool length over a change of unit, so none is in force here.
            self.lines += ["G49", f"G0 {self.axes('XYZ', least=3)}"]
            self.inch = not self.inch
            self.lines.append("G20 F20" if self.inch else "G21 F500")
        elif kind == 8:
            self.lines.append(r.choice(["G54", "G55", "G56", "G59.1", "G59.3"]))
        elif kind == 9:
            turn = f"R{r.uniform(-90, 90):.3f}" if r.random() < 0.5 else ""
            level = r.choice(["L2", "L20"])
            turn = "" if level == "L20" else turn
            self.lines.append(f"G10 {level} P{r.randint(1, 9)} {self.axes('XYZAB')} {turn}")
            if turn:  # rs274 does not turn the present point when the offset in force turns
                self.lines.append(f"G0 {self.axes('XYZ', least=3)}")
        elif kind == 10:
            self.lines.append(
                r.choice([f"G92 {self.axes('XYZ')}", "G92.1", "G92.2", "G92.3", f"G52 {self.axes('XYZ')}"])
            )
        elif kind == 11:
            tool = r.choice([1, 2, 3])
            # Nor does it know where it stands after a tool change, so all of X, Y, Z are given.
            length = r.choice([f"G43 H{tool}", "G43", "G49", "G43.1 Z2.5"])
            self.lines += ["G49", f"T{tool} M6", length, f"G0 {self.axes('XYZ', least=3)}"]
        else:
            self.lines.append(
                r.choice([f"G53 G0 {self.axes('XYZ')}", f"G53 G1 {self.axes('XYZ')}", "G28", f"G30 {self.axes('XYZ')}"])
            )
            self.lines.append("G1 X1")

    def program(self, statements: int = 40) -> str:
        for _ in range(statements):
            self.statement()
        return "\n".join([*self.lines, "G1 X3 Y3", "M2", ""])


@pytest.mark.parametrize("seed", range(40))
def test_random_programs(seed, tmp_path):
    text = Writer(seed).program()
    program = tmp_path / "random.ngc"
    program.write_text(text)
    canon = rs274.run(program, tmp_path, TABLE_RS274)
    assert not canon.error, f"{canon.error}\n{text}"
    table = tmp_path / "ours.tbl"
    table.write_text(TABLE_OURS)
    assert_same_path(read_program(program, tool_table=table), canon)


def cycle_program(seed: int) -> str:
    """Runs of drilling cycles whose R, return mode, distance mode and code change on the way."""
    r = random.Random(seed)
    plane, first, second, normal = r.choice([("G17", *"XYZ"), ("G18", *"XZY"), ("G19", *"YZX")])
    lines = [f"F100 G0 {normal}{r.choice([0, 5, 10, 20])}", plane]
    running, incremental = False, False
    for _ in range(r.randint(3, 10)):
        if r.random() < 0.2:
            move = f"G{r.choice([0, 1])} {first}{r.randint(0, 9)} {normal}{r.randint(0, 15)}"
            lines.append(r.choice(["G80", move, f"G80 {move}"]))
            running = False
            continue
        words = [r.choice(["", "", "G98", "G99"])]
        if r.random() < 0.1:
            incremental, running = not incremental, False
            words.append("G91" if incremental else "G90")
        if not running or r.random() < 0.3:
            code = r.choice(["G81", "G82 P0.1", "G83 Q1.73", "G73 Q1.73", "G85", "G89 P0.1"])
            words.append(f"{code} {normal}{-r.randint(4, 9)} R{r.randint(-2, 12)}")
            running = True
        elif r.random() < 0.3:
            words.append(f"R{r.randint(-2, 12)}")
        words += [r.choice(["", "", "", "L2"]), f"{first}{r.randint(1, 9)}"]
        words.append(r.choice(["", f"{second}{r.randint(1, 9)}"]))
        lines.append(" ".join(words))
    return "\n".join([*lines, "G80", "G90 G1 X50 Y50", "M2", ""])


@pytest.mark.parametrize("seed", range(40))
def test_runs_of_cycles(seed, tmp_path):
    program = tmp_path / "cycles.ngc"
    program.write_text(cycle_program(seed))
    canon = rs274.run(program, tmp_path)
    try:
        read = read_program(program)
    except TpsError as error:  # a hole above its R plane, which both refuse
        assert "below the bottom" in str(error)
        assert "R value" in canon.error or "R less" in canon.error, canon.error
        return
    assert not canon.error
    assert_same_path(read, canon)


@pytest.mark.parametrize(
    "text",
    [
        "G0 G17 G40 G49 G80 G90\nF100 G80 G1 X5\nG81 G80 X3 Z-1 R2\nX7\nG0 G80 X4",
        "F100 G0 X10\nG3 X0 Y10 I-10 A30 B5 Z3\nG18 G2 X5 Z8 R7 C20\nG91 G19 G3 Y2 Z2 J1 K1 A3",
        "F100 G1 X5 Y5\nG91 G10 L2 P1 X3 Y4\nG1 X1 Y1\nG10 L2 P2 R30 X1\nG55 G1 X2\nG10 L20 P2 X7 Y1\nG90 X0 Y0",
        "F100 G10 L2 P1 R25\nG1 X5 Y5\nG92 X1 Y1\nG1 X2 Y3\nG55 X1\nG54 X0\nG92.2 X9\nX1\nG92.3\nX1",
        "G20 F10 G1 X1 Y1 Z1\nG53 G1 X2 Z3\nG10 L2 P1 X1\nG53 G0 Z0\nG1 X0 Y0 Z0",
    ],
)
def test_chosen_programs(text, tmp_path):
    program = tmp_path / "chosen.ngc"
    program.write_text(text + "\nM2\n")
    canon = rs274.run(program, tmp_path)
    assert not canon.error
    assert_same_path(read_program(program), canon)


def debian_programs() -> list[Path]:
    """NC programs that Debian's linuxcnc-uspace installs and that run nothing."""
    if not rs274.AVAILABLE or shutil.which("dpkg") is None:
        return []
    listing = subprocess.run(["dpkg", "-L", "linuxcnc-uspace"], capture_output=True, text=True, check=False).stdout
    files = [Path(line) for line in listing.splitlines() if line.endswith((".ngc", ".nc"))]
    return [f for f in files if f.is_file() and not rs274.UNSAFE.search(f.read_text(errors="replace"))]
