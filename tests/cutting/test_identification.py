"""Coefficients from slots: known ones come back from forces with noise, by closed forms and by whole records."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom
from scipy.stats import t as student

import toolpath_stiff as tps
from tests.cutting.test_forces import patch, sliced
from toolpath_stiff.cli.main import main
from toolpath_stiff.cutting.coefficients import (
    SHOWN,
    Coefficients,
    coefficients_from,
    material,
    materials,
    read_coefficients,
)
from toolpath_stiff.cutting.cutters import Cutter
from toolpath_stiff.cutting.identification import least_squares, left_out, slot_responses
from toolpath_stiff.errors import InputError
from toolpath_stiff.readings.force_records import mean_force

FLAT = Cutter(1, 0.010, 0.0, 3, np.radians(30.0))
BULL = Cutter(1, 0.010, 0.001, 3, np.radians(30.0))
KNOWN = np.array([800e6, 250e6, 150e6, 20e3, 25e3, 2e3])
FEEDS = np.array([2e-5, 4e-5, 6e-5, 8e-5, 1e-4])
SETS, NOISE = 200, 2.0  # N, standard deviation of a mean force


def slot_means(feed, depth=0.003, flutes=3):
    """(n, 3) N: Altintas, Manufacturing Automation, 2nd ed., equation 2.43, x along the feed, forces on the tool."""
    t, r, a, te, re, ae = KNOWN
    return flutes * depth * np.stack(
        [-(r * feed / 4 + re / np.pi), t * feed / 4 + te / np.pi, -(a * feed / np.pi + ae / 2)], axis=1
    )  # fmt: skip


def test_intervals_hold_the_known_coefficients_95_times_in_100():
    rng = np.random.default_rng(27)
    response, depth = slot_responses(FLAT, FEEDS, np.full(5, 0.003)), 0.003
    reach = student.ppf(0.975, 3)
    outside, variances, mixed = np.zeros(6, dtype=int), [], []
    for _ in range(SETS):
        force = slot_means(FEEDS, depth) + rng.normal(0.0, NOISE, (5, 3))
        values, covariance, told = least_squares(response, force)
        assert told.all()
        deviation = np.sqrt(np.diagonal(covariance))
        outside += np.abs(values - KNOWN) > reach * deviation
        variances.append(deviation**2)
        mixed.append(covariance[0, 3] / deviation[0] / deviation[3])
    # 4 standard deviations to either side of 5 % of 200 draws; of all six together, pairs hanging together, below.
    assert outside.max() <= binom.mean(SETS, 0.05) + 4 * binom.std(SETS, 0.05)
    assert outside.sum() >= 60 - 4 * np.sqrt(2) * binom.std(3 * SETS, 0.05)
    # Closed form of the straight line: 14.1 N/mm2 and 0.73 N/mm, correlated by -0.905.
    assert np.sqrt(np.mean(variances, axis=0))[[0, 3]] * SHOWN[[0, 3]] == pytest.approx([14.1, 0.73], rel=0.15)
    assert np.mean(mixed) == pytest.approx(-0.905, abs=1e-3)


@pytest.mark.parametrize("cutter", [FLAT, BULL])
def test_exact_forces_give_exact_coefficients(cutter):
    depth = np.array([0.002, 0.003, 0.003, 0.004, 0.002])
    response = slot_responses(cutter, FEEDS, depth)
    force = (response * KNOWN).sum(axis=-1)
    values, _, _ = least_squares(response, force)
    assert values == pytest.approx(KNOWN, rel=1e-6)
    assert left_out(response, force, FEEDS) == pytest.approx(0.0, abs=1e-6)


def test_what_was_not_recorded_is_not_told():
    force = slot_means(FEEDS)
    force[:, 2] = np.nan
    values, covariance, told = least_squares(slot_responses(FLAT, FEEDS, np.full(5, 0.003)), force)
    assert told.tolist() == [True, True, False] * 2
    assert values[[2, 5]].tolist() == [0.0, 0.0]
    assert np.sqrt(covariance[2, 2]) == pytest.approx(0.3 * values[0])
    with pytest.raises(InputError, match="do not tell the coefficients apart"):
        least_squares(slot_responses(BULL, FEEDS, np.full(5, 0.003)), np.full((5, 3), [np.nan, 1.0, np.nan]))


@cache
def turn_of(fed, run_out):
    """(120, 3) N on the tool around a turn of a slot 3 mm deep; mm, m."""
    cutter = Cutter(1, 0.010, 0.0, 3, np.radians(30.0), run_out=run_out, run_out_angle=0.5)
    angles = np.arange(0.0, 2 * np.pi, np.pi / 60)
    return np.array([sliced(cutter, KNOWN, fed / 1e3, 0.0, patch(0.003, 0, np.pi), a, 1e-6, 250) for a in angles])


def write_records(folder, feeds=(0.03, 0.05, 0.07, 0.09), run_out=6e-6, seed=1, **given):
    """Files of records as a dynamometer writes them: forces on the work in kN, drift, noise, air, another speed."""
    rng, files = np.random.default_rng(seed), []
    for fed in feeds:
        turn = turn_of(fed, run_out)
        rate = 100.0 * 1.004  # turns a second; 6,000 a minute are said
        time = np.arange(0.0, 0.5 + 3.0 * 5.0 / (fed * 3 * 100.0), 1 / 2917.0)
        filled = np.clip((time - 0.2) / (5.0 / (fed * 3 * 100.0)), 0.0, 1.0) * (time < time[-1] - 0.2)
        force = np.stack([np.interp(time * rate % 1, np.arange(120) / 120, f, period=1) for f in turn.T], axis=1)
        read = -force * filled[:, None] + [3, -2, 1] + np.outer(time, [4, 3, -6]) + rng.normal(0, NOISE, force.shape)
        rows = [f"{t:.6f};{x / 1e3:.6f};{y / 1e3:.6f};{z / 1e3:.6f}" for t, (x, y, z) in zip(time, read, strict=True)]
        file = folder / f"slot{1000 * fed:.0f}.csv"
        file.write_text("\n".join(["Zeit;Kraft X;Kraft Y;Kraft Z", *rows]))
        mapping = {"time": "Zeit:s", "fx": "Kraft X:kN", "fy": "Kraft Y:kN", "fz": "Kraft Z:kN", "spindle_rpm": "=6000",
                   "depth": "=3", "feed_per_tooth": f"={fed}", **given}  # fmt: skip
        toml = "".join(f'{key} = "{value}"\n' for key, value in mapping.items() if value)
        (folder / f"{file.name}.columns.toml").write_text(toml)
        files.append(str(file))
    (folder / "cut.toml").write_text("[[tool]]\nnumber = 4\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30\n")
    return files, str(folder / "cut.toml")


def test_records_give_coefficients_and_run_out(tmp_path, capsys):
    files, cut = write_records(tmp_path)
    assert main(["forces", *files, "--cut", cut, "--material", "a metal", "--out", str(tmp_path / "out")]) == 0
    text = capsys.readouterr().out
    assert "slots, coefficients with intervals of 95 %" in text
    assert "thinner chips, as in finishing, are extrapolated" in text
    document = json.loads((tmp_path / "out" / "forces.json").read_text())
    for (symbol, (low, high)), known in zip(document["interval_95_percent"].items(), KNOWN * SHOWN, strict=True):
        middle, half = (low + high) / 2, (high - low) / 2
        assert abs(middle - known) < 2 * half + 0.005 * known, symbol  # 95 % of sets are within half of it
        assert half < 0.15 * known, symbol
    assert document["run_out_um"] == pytest.approx([6.0] * 4, abs=0.5)
    read = read_coefficients(tmp_path / "out" / "forces.json")
    assert read.values == pytest.approx(
        np.array(document["coefficients"]["cutting_N_per_mm2"] + document["coefficients"]["edge_N_per_mm"]) / SHOWN
    )
    assert (read.thinnest, read.thickest, read.material) == (pytest.approx(3e-5), pytest.approx(9e-5), "a metal")
    fit = tps.forces(files, cut, material="a metal")
    assert json.loads(fit.to_json()) == document
    assert len(fit.to_frame()) == 4
    assert (tmp_path / "out" / "forces.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.parametrize("entry", [0, 45])
@pytest.mark.parametrize("swing", [10.0, 60.0])
def test_a_slot_may_swing_less_than_its_entry(entry, swing):
    """Many teeth even the force of a slot out, which a single tooth of the entry is not; nor need there be an entry."""
    turns = np.arange(20 + entry + 60 + 20)
    level = np.clip((turns - 20.0 + 0.5) / max(entry, 0.5), 0.0, 1.0) * (turns < len(turns) - 20)
    amplitude = np.where(level <= 0.0, 0.0, np.where(level < 1.0, 60.0, swing))
    time = np.arange(0.0, len(turns) / 100.0, 1 / 5000.0)
    turn = (time * 100.0).astype(int)
    force = level[turn] * 80.0 + amplitude[turn] * np.sin(2 * np.pi * 300.0 * time) + 5.0 * time
    noise = np.random.default_rng(2).normal(0.0, 1.0, (2, len(time)))
    signal = np.stack([time, noise[0], force + noise[1], 0.5 * force], axis=1)
    mean, _, remarks = mean_force("slot", signal, 100.0, FLAT, 4e-5, 1)
    assert mean == pytest.approx([0.0, 80.0, 40.0], abs=0.5) and not remarks


BROKEN = {
    "an axis points the other way": ({}, {"axes": "x,-y,z"}, "Ktc = -"),
    "two axes are exchanged": ({}, {"axes": "-y,x,z"}, "Ktc = -"),
    "no such axes": ({}, {"axes": "x,x,z"}, "axes x,x,z"),
    "one feed": ({"feeds": (0.03,)}, {}, r"slots at 1 feed\b"),
    "two feeds": ({"feeds": (0.03, 0.05)}, {}, "slots at 2 feeds"),
    "a tool that is not there": ({}, {"tool": 7}, "no tool 7"),
    "no depth": ({"depth": ""}, {}, "column depth_mm is missing"),
    "a depth below nothing": ({"depth": "=-3"}, {}, "depth_mm = -3"),
    "no number": ({"depth": "=deep"}, {}, "depth_mm = 'deep'"),
    "nothing but zeros": ({"fx": "=0", "fy": "=0", "fz": "=0"}, {}, "do not tell the coefficients apart"),
    "no forces of this world": ({"fy": "=1e300"}, {}, r"slot60.csv:2: fy_N = 1e300; expected at most 1e\\+06 N"),
    "a speed far off": ({"spindle_rpm": "=60"}, {}, "whole turns of the full slot"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_records_that_are_refused(tmp_path, name):
    given, options, message = BROKEN[name]
    files, cut = write_records(tmp_path, **{"feeds": (0.06, 0.08, 0.1), "run_out": 0.0, **given})
    with pytest.raises(InputError, match=message):
        tps.forces(files, cut, **options)


def test_feed_in_mm_a_minute_is_that_of_the_teeth(tmp_path):
    files, cut = write_records(tmp_path, (0.06, 0.08, 0.1), 0.0)
    first = tps.forces(files, cut)
    for file, fed in zip(files, (0.06, 0.08, 0.1), strict=True):
        mapping = tmp_path / f"{file}.columns.toml"
        mapping.write_text(
            mapping.read_text()
            .replace("feed_per_tooth =", "feed_mm_per_min =")
            .replace(f'"={fed}"', f'"={fed * 3 * 6000}"')
        )
    assert tps.forces(files, cut).coefficients.values == pytest.approx(first.coefficients.values, rel=1e-9)


def test_a_table_of_mean_forces(tmp_path):
    """As papers print them, forces on the tool: the textbook's straight lines give the known coefficients back."""
    _, cut = write_records(tmp_path, ())
    rows = [f"{fed * 1e3},{x},{y},{z}" for fed, (x, y, z) in zip(FEEDS, slot_means(FEEDS), strict=True)]
    file = tmp_path / "means.csv"
    file.write_text("\n".join(["fz per tooth,Fx,Fy,Fz", "mm,N,N,N", *rows]))
    mapping = {"feed_per_tooth": "fz per tooth", "fx": "Fx", "fy": "Fy", "fz": "Fz", "depth": "=3"}
    fit = tps.forces(file, cut, columns=mapping, axes="-x,-y,-z")
    assert fit.coefficients.values == pytest.approx(KNOWN, rel=1e-9)
    assert np.isnan(fit.run_out).all() and "mean forces" in fit.silent[-1] and "run-out, by" not in str(fit)
    assert "does the third axis point down?" in str(tps.forces(file, cut, columns=mapping, axes="-x,-y,z"))
    with pytest.raises(InputError, match="of forces on the tool --axes=-x,-y,-z"):
        tps.forces(file, cut, columns=mapping)
    file.write_text("\n".join(["fz per tooth,Fx,Fy,Fz", *rows * 100]))
    with pytest.raises(InputError, match="column time_s is missing"):
        tps.forces(file, cut, columns=mapping)


def test_materials_have_origins_and_bands():
    assert {"Al7075", "Al6082", "C45", "Ti6Al4V"} <= set(materials())
    for coefficients in materials().values():
        assert "doi" in coefficients.origin or "ISCAR" in coefficients.origin
        assert "standard deviation of 30 % assumed" in coefficients.origin
        assert np.linalg.eigvalsh(coefficients.covariance * SHOWN * SHOWN[:, None])[0] > -1e-9
    aluminium = material("al7075")
    assert aluminium.values * SHOWN == pytest.approx([767, 169, 222, 27.7, 26.6, 0.7])
    assert aluminium.deviation == pytest.approx(0.3 * aluminium.values)
    assert "Kac, Kae not known: 0 +- 0.3 Ktc and 1 Kte assumed" in material("C45").origin
    with pytest.raises(InputError, match="expected one of Al7075"):
        material("cheese")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cutting_N_per_mm2": [1, 2]}, "cutting_N_per_mm2"),
        ({"cutting_N_per_mm2": [-5, 2, 3]}, "cutting_N_per_mm2"),
        ({"edge_N_per_mm": "much"}, "edge_N_per_mm"),
        ({"origin": ""}, "origin"),
        ({"spread_percent": -1}, "spread_percent"),
        ({"covariance": [[1, 2], [3, 4]]}, "covariance"),
        ({"covariance": (-np.eye(6)).tolist()}, "covariance"),
        ({"Ktc": 3}, "Ktc is not known"),
        ({"edge_sets_in_um": 0}, "edge_sets_in_um = 0"),
    ],
)
def test_numbers_that_are_no_coefficients(tmp_path, change, message):
    sound = Coefficients(KNOWN[:3], KNOWN[3:], np.diag(KNOWN) * 1e3, "a metal", "made up", 1e-5, 2e-5)
    file = tmp_path / "forces.json"
    file.write_text(json.dumps({"coefficients": sound.document()}))
    again = read_coefficients(file)
    assert again.values == pytest.approx(sound.values)
    assert again.covariance == pytest.approx(sound.covariance)
    file.write_text(json.dumps({"coefficients": {**sound.document(), **change}}))
    with pytest.raises(InputError, match=message):
        read_coefficients(file)
    file.write_text('{"coefficients": 3}')
    with pytest.raises(InputError, match="expected a table"):
        read_coefficients(file)


def test_a_stated_spread_is_the_same_for_all():
    table = {
        "cutting_N_per_mm2": [800, 200, float("nan")],
        "edge_N_per_mm": [20, 20, 1],
        "origin": "a guess",
        "spread_percent": 10,
    }
    coefficients = coefficients_from(table, lambda key, mistake, expected: InputError(mistake))
    assert coefficients.deviation * SHOWN == pytest.approx([80, 20, 240, 2, 2, 0.1])
    assert coefficients.origin.startswith(
        "a guess; Kac not known: 0 +- 0.3 Ktc and 1 Kte assumed; the force at the edge"
    )
    given = coefficients_from({**table, "edge_sets_in_um": 0.01}, lambda key, mistake, expected: InputError(mistake))
    assert (given.taper, given.document()["edge_sets_in_um"]) == (1e-8, 0.01)
    assert given.origin == "a guess; Kac not known: 0 +- 0.3 Ktc and 1 Kte assumed"


DYNOWARE = """DynoWare,Version 2.5.1.2
Path:,C:\\Users\\Administrator\\Desktop\\20180315\\
Filename:,slot.dwd
Manipulated:,0
Date:,
Time:,
Sampling rate [Hz]:,2917
Cycle No:,1
Time,Fx,Fy,Fz
s,N,N,N
"""
LABVIEW = """LabVIEW Measurement
Separator\tTab
Decimal_Separator\t,
X_Columns\tNo
Date\t2019/07/22
***End_of_Header***

Channels\t3
X_Dimension\tTime\tTime\tTime
***End_of_Header***
X_Value\tForce_0\tForce_1\tForce_2\tComment
"""
NAMES = {"time": "Time", "fx": "Fx", "fy": "Fy", "fz": "Fz"}
FORCE = {"sample_rate_Hz": "=2917", "fx": "Force_0", "fy": "Force_1", "fz": "Force_2"}
# What stands above the rows, what between cells, the unit of force in kN, the mapping.
INSTRUMENTS = {
    "DynoWare": (DYNOWARE, ",", 1e3, NAMES),
    "DynoWare in kN": (DYNOWARE.replace("s,N,N,N", "s,kN,kN,kN"), ",", 1.0, NAMES),
    "LabVIEW, without a column of time": (LABVIEW, "\t", 1e3, FORCE),
    "semicolons, units in brackets": ("slot\nTime;Fx;Fy;Fz\n[s];[kN];[kN];[kN]\n", ";", 1.0, NAMES),
}


@pytest.mark.parametrize("instrument", INSTRUMENTS)
def test_files_as_instruments_write_them(tmp_path, instrument):
    """Lines above the heading, a row of units, decimal commas, no column of time: the same coefficients."""
    files, cut = write_records(tmp_path, (0.06, 0.08, 0.1), 0.0)
    first = tps.forces(files, cut)
    head, separator, factor, mapping = INSTRUMENTS[instrument]
    for file in map(Path, files):
        rows = [[float(cell) for cell in line.split(";")] for line in file.read_text().splitlines()[1:]]
        lines = [separator.join([f"{t:.6f}", *(f"{factor * force:.6f}" for force in forces)]) for t, *forces in rows]
        text = "\n".join(lines)
        file.write_text(head + (text if separator == "," else text.replace(".", ",")))
        beside = tmp_path / f"{file.name}.columns.toml"
        constants = [line for line in beside.read_text().splitlines() if '"=' in line]
        beside.write_text("\n".join(constants))
    fit = tps.forces(files, cut, columns=mapping)
    assert fit.coefficients.values == pytest.approx(first.coefficients.values, rel=2e-3)
    assert fit.force == pytest.approx(first.force, abs=0.05)
    assert "above the heading are skipped" in " ".join(fit.notes)
