"""Records as test rigs write them: several cycles, hysteresis, drift, one file a strut, other units, lost readings."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import toolpath_stiff as tps
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.loop_figures import turns_of

K = 40e6  # N/m
PEAK = 1000.0  # N


def ramps(cycles: int, n: int = 20):
    """0, +1000, -1000, +1000 ... 0 N."""
    ends = [0.0, *[PEAK, -PEAK] * cycles, 0.0]
    ways = [np.linspace(a, b, n if 0.0 in (a, b) else 2 * n)[1:] for a, b in pairwise(ends)]
    return np.concatenate([[0.0], *ways])


def slips(force, share: float = 0.2):
    """Masing's hysteresis: play operators of the force at three thresholds beside a spring; their secant is K."""
    thresholds = PEAK * np.array([0.1, 0.25, 0.45])
    played = np.zeros((len(force), 3))
    for i in range(1, len(force)):
        played[i] = np.clip(played[i - 1], force[i] - thresholds, force[i] + thresholds)
    lag = played.mean(axis=1)
    return ((1.0 - share) * force + share * lag * PEAK / (PEAK - thresholds.mean())) / K


def written(force, deflection, date: str = "2021-03-04") -> str:
    rows = [f"3,{date},{f:.3f},{1e6 * y:.4f}" for f, y in zip(force, deflection, strict=True)]
    return "strut,date,force_N,displacement_um\n" + "\n".join(rows) + "\n"


@pytest.fixture
def reduced(tmp_path):
    def reduce(text: str, **options):
        file = tmp_path / "raw.csv"
        file.write_text(text, encoding="utf-8")
        return tps.reduce(file, **options)

    return reduce


def test_turns_alternate_and_noise_adds_none():
    force = ramps(3) + 5.0 * np.random.default_rng(1).standard_normal(len(ramps(3)))
    turns = turns_of(force)
    assert len(turns) == 6 and np.sign(force[turns]).tolist() == [1, -1, 1, -1, 1, -1]
    assert turns_of(np.array([0.0, 1.0, 2.0, 1.0, 0.0, -2.0, 0.0])) == [2, 5]


def test_a_steady_drift_is_no_stiffness(reduced):
    """15 um over three cycles on 50 um between the extremes: the mean of the extremes would be 5 % off."""
    force = ramps(3)
    drift = np.linspace(0.0, 15e-6, len(force))
    (loop,) = reduced(written(force, force / K + drift)).to_dict()["loops"]
    assert loop["stiffness_N_per_mm"] == pytest.approx(40_000.0, rel=1e-4)


def test_hysteresis_is_neither_two_sides_nor_counted_thrice(reduced):
    """The virgin curve and one way alone curve; the closed cycle does so alike on both sides of zero."""
    found = [reduced(written(ramps(n), slips(ramps(n)))).to_dict() for n in (2, 3)]
    for one in found:
        (loop,) = one["loops"]
        assert loop["stiffness_N_per_mm"] == pytest.approx(40_000.0, rel=1e-2)
        assert abs(one["history"]["struts"][0]["sides"]["difference_percent"]) < 1.0
    two, three = (one["loops"][0]["loop_width_um"] for one in found)
    assert two == pytest.approx(three, rel=1e-3)  # of one cycle, however many there are


def test_two_sides_are_found_beside_hysteresis(reduced):
    force = ramps(2)
    found = reduced(written(force, slips(force, 0.02) + np.maximum(force, 0.0) * 0.25 / K)).to_dict()
    assert found["history"]["struts"][0]["sides"]["difference_percent"] == pytest.approx(-20.0, abs=1.0)


def test_sides_of_an_open_loop_are_not_read_off_its_hysteresis(reduced):
    found = reduced(written(ramps(1), slips(ramps(1)))).to_dict()
    assert found["history"]["struts"][0]["sides"] is None


def test_noise_about_zero_of_a_strut_that_is_only_pushed_is_no_lost_motion(reduced):
    force = -np.abs(ramps(2)) + 3.0 * np.random.default_rng(2).standard_normal(len(ramps(2)))
    (loop,) = reduced(written(force, force / K)).to_dict()["loops"]
    assert loop["lost_motion_um"] is None and loop["stiffness_N_per_mm"] == pytest.approx(40_000.0, rel=1e-3)


def test_many_files_are_one_history(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = []
    for year in range(2016, 2024):
        names.append(f"strut3_{year}-05-01.csv")
        stiffness = K * (0.85 if year > 2019 else 1.0) * (1.0 + 1e-3 * (year % 3))
        rows = [f"{year}-05-01,{f:.2f},{1e6 * f / stiffness:.4f},ok" for f in ramps(1, 5)]
        Path(names[-1]).write_text("\n".join(["date,force_N,displacement_um,remark", *rows]), encoding="utf-8")
    assert main(["reduce", *names, "--columns", "strut==3", "--no-plots", "--out", "all.csv"]) == 0
    told = capsys.readouterr()
    assert "strut 3 became 15 % softer between 2019-05-01 and 2020-05-01" in told.out
    assert "column remark is not used" in told.err and len(Path("all.csv").read_text().splitlines()) == 9


def test_a_table_of_stiffnesses_is_a_history(reduced, tmp_path):
    rows = [
        f"{strut};{year}-05-01;{40.0 - 4.0 * (strut == 4 and year > 2019) + 0.01 * (year % 3):.2f}"
        for strut in (3, 4)
        for year in range(2016, 2024)
    ]
    found = reduced("\n".join(["strut;date;Stiffness [N/um]", *rows]), columns="stiffness=Stiffness [N/um]")
    texts = [one["text"] for one in found.to_dict()["history"]["struts"]]
    assert "no change" in texts[0] and "became 10 % softer between 2019-05-01 and 2020-05-01" in texts[1]
    names = [path.name for path in found.save(tmp_path / "m.csv")]
    assert names == ["m.csv"] and "40,007 to 36,010" in str(found)
    again = tps.reduce(tmp_path / "m.csv").to_dict()["history"]
    assert [one["text"] for one in again["struts"]] == texts


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("strut,date,force_N,displacement_um\n1,13/03/2021,0,0\n1,03/13/2021,0,0\n", "date '13/03/2021'"),
        ("strut,date,force_N,displacement_um\n1,2020-01-01,1,25\n1,2020-01-01,-1,-25\n", "force=force_N:kN"),
        ("strut,date,force_N,displacement_um\n1,2020-01-01,9e2,-25\n1,2020-01-01,-9e2,25\n", "count positive the same"),
        ("strut,force_N,disp [counts]\n1,0,0\n", r"displacement_um is missing .found strut, force_N, disp"),
        ("strut,force_N,force_N,displacement_um\n1,0,0,0\n", "force_N stands twice"),
        ("strut,force_mm,displacement_um\n1,0,0\n", "column 'force_mm'; expected force_N.*force=force_mm:N"),
        ("strut,force_N,displacement_um\n0,0,0\n6,0,0\n", "strut '0'; expected 1 to 6"),
        ("strut,stiffness_N_per_mm\n1,40\n", "is the unit right"),
    ],
)  # fmt: skip
def test_what_to_do_is_said(reduced, text, message):
    with pytest.raises((InputError, InputErrors), match=f"(?i){message}"):
        reduced(text)


def test_lost_readings_are_passed_over(reduced):
    found = reduced(written(ramps(2), ramps(2) / K) + "3,2021-03-04,,0\n3,2021-03-04,0,NaN\n")
    assert found.to_dict()["loops"][0]["stiffness_N_per_mm"] == pytest.approx(40_000.0, rel=1e-4)
    assert any("2 records without force or displacement" in note for note in found.notes)


def years(stiffness, soft: float = 1.0, turned=(), dates=range(2016, 2022)):
    """Text a date of strut 3 with stiffness(date) N/m in compression and `soft` times that in tension."""
    force = ramps(2)
    found = {}
    for date in dates:
        k = np.where(force > 0.0, soft, 1.0) * stiffness(date) * (1.0 + 0.001 * (-1.0) ** date)
        sign = -1.0 if date in turned else 1.0
        found[date] = written(sign * force, sign * slips(k[0] * force / k) * K / k[0])
        found[date] = found[date].replace("2021-03-04", f"{date}-03-04")
    return found


@pytest.fixture
def over_years(tmp_path):
    def reduce(texts, **options):
        for date, text in texts.items():
            (tmp_path / f"{date}.csv").write_text(text, encoding="utf-8")
        return tps.reduce(*sorted(tmp_path.glob("*.csv")), **options)

    return reduce


def test_both_sides_go_on_to_the_measurement_file(over_years, tmp_path):
    found = over_years(years(lambda date: K, soft=0.8))
    (file,) = (Path(name) for name in found.save(tmp_path / "rows_measurements.csv", plots=False))
    rows = pd.read_csv(file)
    assert len(rows) == 12 and sorted(np.sign(rows["strut_force_N"]).unique()) == [-1.0, 1.0]
    read = rows.groupby(np.sign(rows["strut_force_N"]))["stiffness_N_per_mm"].mean()
    assert read[-1.0] / read[1.0] == pytest.approx(1.25, rel=0.02)


def test_compression_that_counts_positive_is_turned(over_years):
    found = over_years(years(lambda date: K, soft=0.8, turned=range(2016, 2022)), compression_positive=True)
    assert found.to_dict()["history"]["struts"][0]["sides"]["difference_percent"] == pytest.approx(-20.0, abs=1.0)


def test_the_last_of_four_dates_is_no_drift(over_years):
    found = over_years(years(lambda date: K * (1.0 if date < 2019 else 0.85), dates=range(2016, 2020)))
    (strut,) = found.to_dict()["history"]["struts"]
    assert not strut["changes"] and strut["wild_dates"] == ["2019-03-04"]


def test_a_strut_pulled_alone_in_one_year_is_not_held_against_the_others(over_years):
    texts = years(lambda date: K, soft=0.8)
    lines = texts[2021].splitlines()
    texts[2021] = "\n".join([lines[0], *(line for line in lines[1:] if float(line.split(",")[2]) >= 0.0)])
    strut, alone = over_years(texts).to_dict()["history"]["struts"]
    assert not strut["changes"] and not strut["wild_dates"] and len(strut["dates"]) == 5
    assert alone["strut"] == "strut 3 alone, in tension alone" and len(alone["dates"]) == 1
