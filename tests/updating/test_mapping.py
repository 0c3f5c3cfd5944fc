"""Mappings of columns: any long table gives the same stiffnesses, and a refusal prints the mapping that reads it."""

from __future__ import annotations

import re
import shlex
from datetime import UTC, datetime

import numpy as np
import pytest
from openpyxl import Workbook

import toolpath_stiff as tps
from toolpath_stiff.cli.main import main
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.dates import day_of
from toolpath_stiff.readings.mapping import as_iso, sources_of
from toolpath_stiff.readings.raw_records import COLUMNS
from toolpath_stiff.tables import Source

STRUTS = range(1, 7)
DATES = ("2019-04-02", "2021-09-16")
FORCE = (0, 500, 1000, 500, 0, -500, -1000, -500, 0, 500, 1000)
TRUTH = {(s, d): 1e3 * (40 + 10 * s + 5 * k) for s in STRUTS for k, d in enumerate(DATES)}  # N/mm
RECORDS = {who: [(f, round(1e3 * f / k, 4)) for f in FORCE] for who, k in TRUTH.items()}  # N, um


def german(date):
    return ".".join(reversed(date.split("-")))


def comma(value):
    return str(value).replace(".", ",")


def epoch_ms(date):
    return int(1000 * datetime.fromisoformat(date).replace(tzinfo=UTC).timestamp())


def long(heading, row):
    return "\n".join([heading, *(row(s, d, f, x) for (s, d), records in RECORDS.items() for f, x in records)])


def table(heading, row):
    return "\n".join([heading, *(row(s, d, k) for (s, d), k in TRUTH.items())])


# Text of a file, and the mapping that reads it.
FILES = {
    "of the house": (
        table("hp,day_ms,stiff_mean", lambda s, d, k: f"{s},{epoch_ms(d)},{k / 1e3}"),
        "strut=hp, date=day_ms:ms, stiffness=stiff_mean:N/um",
    ),
    "German": (
        long("Bein;Datum;Kraft [kN];Weg [mm]", lambda s, d, f, x: f"{s};{german(d)};{comma(f / 1e3)};{comma(x / 1e3)}"),
        "strut=Bein, date=Datum:DD.MM.YYYY, force=Kraft [kN]:kN, displacement=Weg [mm]:mm",
    ),
    "units of the headings": (
        long("strut,date,Force [kN],Displacement [mm]", lambda s, d, f, x: f"{s},{d},{f / 1e3},{x / 1e3}"),
        "force=Force [kN], displacement=Displacement [mm]",
    ),
    "quotes": (
        long('"Bein: Nr.",Tag,"Kraft, kgf",Weg',
             lambda s, d, f, x: f"{s},{d[8:]}/{d[5:7]}/{d[:4]},{f / 9.80665},{x / 25.4}"),
        'strut="Bein: Nr.", date=Tag:DD/MM/YYYY, force="Kraft, kgf":kgf, displacement=Weg:mil',
    ),
    "tabs": (
        long("leg\tday\tF\tu", lambda s, d, f, x: f"{s}\t{d.replace('-', '')}\t{f / 1e3}\t{x}"),
        "strut=leg, date=day:YYYYMMDD, force=F:kN, displacement=u",
    ),
}  # fmt: skip


def stiffnesses(found):
    return {
        (int(one.loop.place["loop"].split()[1]), one.loop.place["date"]): one.stiffness / 1e3 for one in found.figures
    }


def assert_true(found):
    read = stiffnesses(found)
    assert read.keys() == TRUTH.keys()
    np.testing.assert_allclose([read[who] for who in TRUTH], list(TRUTH.values()), rtol=2e-4)


@pytest.fixture
def write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def file(text, name="a.csv"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return name

    return file


def mapping_of(message):
    """The words after --columns in a message, as a shell has them."""
    return shlex.split(re.search(r"--columns ('[^']*'|\"[^\"]*\")", message)[1])[0]


@pytest.mark.parametrize("layout", FILES)
def test_a_mapping_reads_any_long_table(layout, write):
    text, mapping = FILES[layout]
    found = tps.reduce(write(text), columns=mapping)
    assert_true(found)
    assert found.read_as[0].startswith("a.csv: ") and len(found.read_as) == 1
    sources = sources_of(mapping, COLUMNS)
    assert all(f"from {source.heading!r}" in found.notes[0] for source in sources.values())


@pytest.mark.parametrize(
    ("layout", "told"),
    [
        ("of the house", ["column strut is missing (found hp, day_ms, stiff_mean)", '--columns "strut=..., force=']),
        ("German", ["(found Bein, Datum, Kraft [kN], Weg [mm])", "or in a.csv.columns.toml"]),
        (
            "units of the headings",
            ["'Force [kN]'", '--columns "force=Force [kN]:kN, displacement=Displacement [mm]:mm" (columns=)'],
        ),
    ],
)
def test_the_refusal_holds_the_mapping_to_write(layout, told, write, capsys):
    assert main(["reduce", write(FILES[layout][0]), "--no-plots"]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1 and "a.csv:1: " in error and all(part in error for part in told)
    if layout == "units of the headings":
        assert_true(tps.reduce("a.csv", columns=mapping_of(error)))


def test_a_toml_beside_the_file_says_the_same(write, capsys):
    text, mapping = FILES["German"]
    write(text)
    entries = [entry.partition("=") for entry in mapping.split(", ")]
    write("\n".join(f'{ours} = "{theirs}"' for ours, _, theirs in entries), "a.csv.columns.toml")
    found = tps.reduce("a.csv")
    assert_true(found)
    assert "a.csv.columns.toml says" in found.notes[0]
    assert main(["reduce", "a.csv", "--no-plots"]) == 0
    assert "a.csv: records of 12 loops from strut, date, force_N, displacement_um" in capsys.readouterr().err
    write("force = ", "a.csv.columns.toml")
    with pytest.raises(InputError, match=r"a.csv.columns.toml:1: a mapping of columns is not TOML"):
        tps.reduce("a.csv")


def test_a_file_a_strut_says_so_once(write):
    for (strut, date), records in RECORDS.items():
        rows = [f"{f},{x}" for f, x in records]
        name = write("\n".join(["force_N,displacement_um", *rows]), f"{strut}_{date}.csv")
        write(f"strut = {strut}\ndate = {date}\n", f"{name}.columns.toml")
    assert_true(tps.reduce("."))
    found = tps.reduce("1_2019-04-02.csv", columns="strut==4, date==2020-06-30")
    assert list(stiffnesses(found)) == [(4, "2020-06-30")]
    with pytest.raises(InputErrors, match=r"rows.csv:3: row with 3 cells; expected 2 as in the heading"):
        tps.reduce(write("force_N,displacement_um\n0,0\n3,12,5\n", "rows.csv"), columns={"strut": "=1"})


def test_a_sheet_is_mapped_like_a_file(tmp_path):
    book = Workbook()
    book.active.append(["measured by hand"])
    sheet = book.create_sheet("bench")
    sheet.append(["Bein", "Tag", "Kraft", "Weg"])
    for (strut, date), records in RECORDS.items():
        for force, moved in records:
            sheet.append([strut, datetime.fromisoformat(date), force, moved])
    book.save(tmp_path / "a.xlsx")
    found = tps.reduce(f"{tmp_path}/a.xlsx#bench", columns="strut=Bein, date=Tag, force=Kraft, displacement=Weg")
    read = {(strut, date[:10]): k for (strut, date), k in stiffnesses(found).items()}
    np.testing.assert_allclose([read[who] for who in TRUTH], list(TRUTH.values()), rtol=2e-4)


def test_measurements_are_mapped_and_hints_carry_the_mapping(write, capsys):
    rows = "\n".join(
        f"{x},0,800,{way},{40 + i}" for i, (x, way) in enumerate((x, w) for x in (0, 50, 99) for w in "XYZ")
    )
    text = f"X [mm],Y [mm],Z [mm],Richtung,Steifigkeit [N/um]\n{rows}\n"
    with pytest.raises(InputError, match="column direction is missing"):
        tps.Measurements.read(write(text))
    mapping = "direction=Richtung, stiffness=Steifigkeit [N/um]:N/um"
    assert tps.Measurements.read("a.csv", columns=mapping).to_frame()["stiffness_N_per_mm"].tolist()[0] == 40_000.0
    assert main(["compare", "a.csv", "--columns", mapping, "--noise", "5", "--no-plots"]) == 0
    assert f"--columns '{mapping}'" in capsys.readouterr().out
    compared = tps.compare("a.csv", "nist", columns={"direction": "Richtung", "stiffness": "Steifigkeit [N/um]:N/um"})
    assert compared.to_dict()["baseline"]["mean_abs_error_percent"] > 0.0


@pytest.mark.parametrize(
    ("mapping", "message"),
    [
        ("strut", "columns 'strut'; expected entries as strut=hp"),
        ("strut=", "expected entries as strut=hp"),
        ("force=a:b:c", "columns: force in 'b:c'; expected a unit as N"),
        ("leg=hp", "columns: leg is no column; expected one of x, y"),
        ("force=F:mm", "columns: force in 'mm'; expected a unit as N"),
        ("setup=a:mm", "columns: setup in 'mm'; expected a unit as none"),
        ("date=day:soon", "columns: date in 'soon'; expected ms, s, or a form"),
        ("strut=hp, force=F", "a.csv:1: no column 'hp'; expected one of 'strut', 'force_N', 'displacement_um'"),
        ("date=strut:DD.MM.YYYY", "a.csv:2: date '1'; expected one as DD.MM.YYYY"),
    ],
)
def test_a_wrong_mapping_is_named(mapping, message, write, capsys):
    write("strut,force_N,displacement_um\n1,0,0\n1,1000,25\n")
    assert main(["reduce", "a.csv", "--columns", mapping]) == 2
    told = capsys.readouterr().err
    assert message in told and len(told.splitlines()) == 1


@pytest.mark.parametrize(
    ("heading", "missing"),
    [
        ("F1_N,d1_um,F2_N,d2_um", "column strut is missing"),  # struts side by side
        ("Date,k1 [N/um],k2 [N/um]", "column strut is missing"),
        ("strut,2019,2020", "column force_N is missing"),  # dates side by side
        ("force_N,displacement_um", "column strut is missing"),  # the file's name says nothing
    ],
)
def test_layouts_are_not_guessed(heading, missing, write):
    text = f"{heading}\n{','.join('1' for _ in heading.split(','))}\n"
    with pytest.raises(InputError, match=missing) as caught:
        tps.reduce(write(text, "strut1.csv"))
    assert '--columns "' in str(caught.value) and "strut1.csv.columns.toml" in str(caught.value)


def test_a_year_alone_is_said_by_a_mapping(write, tmp_path):
    rows = [f"3,{year},{40 - 8 * (year > 2018) + 0.01 * (year % 3)}" for year in range(2014, 2024)]
    found = tps.reduce(write("\n".join(["strut,year,k", *rows])), columns="date=year:YYYY, stiffness=k:N/um")
    assert "softer between 2018-01-01 and 2019-01-01" in str(found)
    found.save(tmp_path / "m.csv", plots=False)
    assert "2014-01-01,40" in (tmp_path / "m.csv").read_text()


@pytest.mark.parametrize(
    ("text", "form", "iso"),
    [("12.03.2021", "DD.MM.YYYY", "2021-03-12"), ("12.3.21", "DD.MM.YY", "2021-03-12"),
     ("3/13/2021", "MM/DD/YYYY", "2021-03-13"), ("12.03.2021 14:05", "DD.MM.YYYY hh:mm", "2021-03-12T14:05:00"),
     ("03/2021", "MM/YYYY", "2021-03-01"),
     ("20210312", "YYYYMMDD", "2021-03-12"), ("1615507200000", "ms", "2021-03-12"),
     ("1615507200", "s", "2021-03-12"), ("31.02.2021", "DD.MM.YYYY", ""), ("soon", "ms", ""), ("1e400", "s", "")],
)  # fmt: skip
def test_dates_are_read_as_the_mapping_says(text, form, iso):
    assert as_iso(text, form) == iso


def test_dates_of_another_form_are_refused_with_what_to_say(write):
    text = "strut,date,stiffness_N_per_mm\n1,12.03.2021,40000\n"
    with pytest.raises(InputErrors, match=r"date '12.03.2021'; expected a date as 2024-03-31.*date=date:DD.MM.YYYY"):
        tps.reduce(write(text))
    assert tps.reduce("a.csv", columns="date=date:DD.MM.YYYY").figures[0].loop.date == "2021-03-12"
    with pytest.raises(InputError, match="date=date:YYYY"):
        day_of("2021-03")


def test_entries_of_a_mapping():
    assert sources_of('strut==3, stiffness_N_per_mm = k :N/um, force="a, b: c":kN', COLUMNS) == {
        "strut": Source("", "", "3"),
        "stiffness_N_per_mm": Source("k", "N/um"),
        "force_N": Source("a, b: c", "kN"),
    }
