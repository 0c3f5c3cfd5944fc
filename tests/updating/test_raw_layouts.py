"""Layouts of raw records: whatever the layout, the same records give the same stiffnesses."""

import datetime
import json

import numpy as np
import pytest

import toolpath_stiff as tps
from toolpath_stiff.errors import InputError, InputErrors
from toolpath_stiff.readings.dates import day_of, read_dates
from toolpath_stiff.readings.raw_labels import strut_label

STRUTS = range(1, 7)
DATES = ("2019-04-02", "2021-09-16")
FORCE = (0, 500, 1000, 500, 0, -500, -1000, -500, 0, 500, 1000)
TRUTH = {(s, d): 1e3 * (40 + 10 * s + 5 * k) for s in STRUTS for k, d in enumerate(DATES)}  # N/mm
RECORDS = {who: [(f, round(1e3 * f / k, 4)) for f in FORCE] for who, k in TRUTH.items()}  # N, um


def german(date):
    return ".".join(reversed(date.split("-")))


def comma(value):
    return str(value).replace(".", ",")


def long(heading, row):
    return "\n".join([heading, *(row(s, d, f, x) for (s, d), records in RECORDS.items() for f, x in records)])


def beside(date, heads, separator=",", shown=str, cells=lambda f, x: (f, x)):
    """Six struts side by side below a heading."""
    rows = [[shown(v) for s in STRUTS for v in cells(*RECORDS[s, date][i])] for i in range(len(FORCE))]
    return "\n".join([*heads, *(separator.join(row) for row in rows)])


def dated(name, text):
    return {name.format(date): text(date) for date in DATES}


def one_each(name, text):
    return {name.format(s, d): text(s, d, records) for (s, d), records in RECORDS.items()}


def columns(heading, records, separator=","):
    return "\n".join([heading, *(f"{f}{separator}{x}" for f, x in records)])


F1D1 = ",".join(f"F{s},d{s}" for s in STRUTS)
LVM = "LabVIEW Measurement\nSeparator\tTab\nDate\t{}\n***End_of_Header***\nY_Unit_Label\tN\tum\n***End_of_Header***\n"
FILES = {
    "dots": {"a.csv": long("Leg;Datum;Kraft [N];Weg [mm]", lambda s, d, f, x: f"{s};{german(d)};{f};{comma(x / 1e3)}")},
    "slashes": {"a.csv": long("strut,Test date,Load (kgf),disp (mil)",
                              lambda s, d, f, x: f"{s},{d[8:]}/{d[5:7]}/{d[:4]},{f / 9.80665},{x / 25.4}")},
    "from zero": {"a.csv": long("actuator,date,force_N,deflection_um", lambda s, d, f, x: f"leg {s - 1},{d},{f},{x}")},
    "letters": {"a.csv": long("Strut,Date,F/N,d/um",
                              lambda s, d, f, x: f"{'ABCDEF'[s - 1]},{d.replace('-', '')},{f},{x}")},
    "compression": {"a.csv": "Compression positive\n"
                    + long("strut,date,force_N,displacement_um", lambda s, d, f, x: f"{s},{d},{-f},{x}")},
    "grouped": {"a.csv": long("strut;date;force_N;displacement_um", lambda s, d, f, x: f"{s};{d};{f:,.1f};{x}")},
    "side by side": dated("rig_{}.csv", lambda d: beside(d, [F1D1, ",".join(["N", "um"] * 6)])),
    "units above": dated("rig_{}.csv", lambda d: beside(d, ['"Units: N, um"', F1D1])),
    "decimal commas": dated("{}.csv", lambda d: beside(
        d, [";".join(f"F{s} [N];d{s} [um]" for s in STRUTS)], ";", comma)),
    "letters above": dated("{}.csv", lambda d: beside(
        d, [",".join(f"{s}," for s in "ABCDEF"), ",".join(["F_N,d_um"] * 6)])),
    "wide letters": {"a.csv": "k [kN/mm],A,B,C,D,E,F\n"
                     + "\n".join(f"{d}," + ",".join(str(TRUTH[s, d] / 1e3) for s in STRUTS) for d in DATES)},
    "three rows": dated("{}.csv", lambda d: beside(
        d, ["Rig 4", ",".join(f"Strut {s}," for s in STRUTS), ",".join(["F,d"] * 6), ",".join(["N,um"] * 6)])),
    "two sensors": dated("{}.csv", lambda d: beside(
        d, [",".join(f"F{s}_N,Leg {s} LVDT 1 [um],Leg {s} LVDT 2 [um]" for s in STRUTS)],
        cells=lambda f, x: (f, x + 1.0, x - 1.0))),
    "one force": dated("{}.csv", lambda d: "\n".join(
        ["Force [N]," + ",".join(f"d{s} [um]" for s in STRUTS)]
        + [",".join(map(str, [f, *(RECORDS[s, d][i][1] for s in STRUTS)])) for i, f in enumerate(FORCE)])),
    "folders": one_each("strut{}/{}.csv", lambda s, d, r: columns("force_N,displacement_um", r)),
    "short names": one_each("S{}_{}.txt", lambda s, d, r: columns("Force [N]\tDisplacement [um]", r, "\t")),
    "spaces": one_each("strut_{}_{}.txt", lambda s, d, r: columns("Force_N   Disp_um", r, "    ")),
    "comments": one_each("{}_{}.dat", lambda s, d, r: columns(f"# strut: {s}\n# date: {d}\n# force_N disp_um", r, " ")),
    "lvm": one_each("leg_{}_{}.lvm", lambda s, d, r: LVM.format(d.replace("-", "/"))
                    + columns("X_Value\tForce\tDisplacement\tComment", [(f"0.5\t{f}", x) for f, x in r], "\t")),
    "footer": one_each("strut{}_{}.csv", lambda s, d, r: columns("force_N,displacement_um", r)
                       .replace("\n500,", "\nhold,\n500,") + "\nMean,12.5\nRemark: second run"),
    "blocks": {"a.csv": "\n".join(columns(f"Strut {s}\nDate: {german(d)}\nForce [N];Disp [um]", r, ";")
                                  for (s, d), r in RECORDS.items())},
    "one heading": {"a.csv": "Force [N];Disp [um]\n" + "\n".join(columns(f"Strut {s}\nDate: {d}", r, ";")
                                                              for (s, d), r in RECORDS.items())},
    "json": {"a.json": json.dumps({"tests": [
        {"strut": f"S{s}", "date": d, "force_N": [f for f, _ in r], "displacement_um": [x for _, x in r]}
        for (s, d), r in RECORDS.items()]})},
    "wide years": {"a.csv": "Strut / k in N/um," + ",".join(DATES) + "\n"
                   + "\n".join(f"{s}," + ",".join(str(TRUTH[s, d] / 1e3) for d in DATES) for s in STRUTS)},
    "wide struts": {"a.csv": "Stiffness [N/um]\nDate,1,2,3,4,5,6\n"
                    + "\n".join(f"{d}," + ",".join(str(TRUTH[s, d] / 1e3) for s in STRUTS) for d in DATES)},
}  # fmt: skip


@pytest.fixture
def reduced(tmp_path, monkeypatch):
    def reduce(files, **options):
        monkeypatch.chdir(tmp_path)
        for name, text in files.items():
            path = tmp_path / "records" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
        return tps.reduce("records", **options)

    return reduce


def stiffnesses(found):
    loops = found.reduced.loops
    return {
        (int(loop.place["loop"].split()[1]), loop.place["date"]): one.stiffness / 1e3
        for loop, one in zip(loops, found.reduced.figures, strict=True)
    }


@pytest.mark.parametrize("layout", FILES)
def test_every_layout_gives_the_same_stiffnesses(layout, reduced):
    found = stiffnesses(reduced(FILES[layout]))
    assert found.keys() == TRUTH.keys()
    np.testing.assert_allclose([found[who] for who in TRUTH], list(TRUTH.values()), rtol=2e-4)


def test_a_workbook_with_merged_heads_and_a_sheet_a_date(tmp_path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.append(["measured by hand"])
    for date in DATES:
        sheet = book.create_sheet(german(date))
        sheet.append([cell for s in STRUTS for cell in (f"Strut {s}", None)])
        sheet.append(["Force [N]", "Displacement [um]"] * 6)
        for s in STRUTS:
            sheet.merge_cells(start_row=1, end_row=1, start_column=2 * s - 1, end_column=2 * s)
        for i in range(len(FORCE)):
            sheet.append([value for s in STRUTS for value in RECORDS[s, date][i]])
    book.save(tmp_path / "a.xlsx")
    found = tps.reduce(tmp_path / "a.xlsx")
    assert any("no records in the sheets Sheet" in note for note in found.notes)
    np.testing.assert_allclose([stiffnesses(found)[who] for who in TRUTH], list(TRUTH.values()), rtol=2e-4)


def test_options_say_what_the_files_do_not(reduced):
    text = long("strut,date,F,d", lambda s, d, f, x: f"{s},{d[8:]}/04/{d[:4]},{-f / 1e3},{x / 1e3}")
    text = text.replace("16/04", "03/04")
    found = reduced({"a.csv": text}, date_order="mdy", units="kN,mm", compression_positive=True)
    assert stiffnesses(found)[1, "2019-02-04"] == pytest.approx(TRUTH[1, DATES[0]], rel=2e-4)
    with pytest.raises(InputError, match="units 'kN,s'"):
        reduced({}, units="kN,s")
    with pytest.raises(InputError, match="date order 'ymd'"):
        reduced({}, date_order="ymd")


def test_a_year_alone_stays_a_year(reduced, tmp_path):
    rows = [f"3,{year},{40 - 8 * (year > 2018) + 0.01 * (year % 3)}" for year in range(2014, 2024)]
    found = reduced({"a.csv": "\n".join(["strut,year,stiffness [N/um]", *rows])})
    assert "softer between 2018 and 2019" in str(found)
    assert any("a year or a month alone counts as its middle: 2014 as 2014-07-02" in note for note in found.notes)
    found.save(tmp_path / "m.csv", plots=False)
    assert "2014,40" in (tmp_path / "m.csv").read_text()


@pytest.mark.parametrize(("start", "message"), [(b"MATLAB 5.0 MAT-file", "a MATLAB file"), (b"TDSm", "a TDMS file")])
def test_files_of_other_tools_are_refused_with_what_to_do(start, message, tmp_path):
    (tmp_path / "a.dat").write_bytes(start + bytes(100))
    with pytest.raises(InputError, match=f"{message}.*(?i:export the channels as CSV)"):
        tps.reduce(tmp_path / "a.dat")


@pytest.mark.parametrize(
    ("text", "message"),
    [("force_N,disp_um\n0,0\n3,12,5\n", "row with 3 cells"), ("F1_N,d1_um,F2_N\n0,0,0\n", "displacement of strut 2"),
     ("F1_N,d1_um,F2_kN,d2_um\n0,0,0,0\n", "different units"),
     ("force_N,disp_um\n0,0\n5,1.2.3\n", "displacement_um = "),
     # One heading less than columns, and a line broken in the middle of a number.
     ("  date   force_N  displacement_um\n" + 2 * " 1  2021-01-01  100  2.500\n" + " 1  2021-01-01  -20\r0  -5.0\n",
      "csv:5: row with 2 cells; expected 4")],
)  # fmt: skip
def test_what_cannot_be_read_is_refused(text, message, reduced):
    with pytest.raises((InputError, InputErrors), match=message):
        reduced({"strut1.csv": text})


# -- dates -------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "iso"),
    [("12.03.2021", "2021-03-12"), ("12.3.21", "2021-03-12"), ("12 Mar 2021", "2021-03-12"), ("2021", "2021"),
     ("March 12, 2021", "2021-03-12"), ("12. März 2021", "2021-03-12"), ("Mar 2021", "2021-03"), ("03/2021", "2021-03"),
     ("20210312", "2021-03-12"), ("44267", "2021-03-12"), ("44267.25", "2021-03-12T06:00"), ("2021/3/12", "2021-03-12"),
     ("Fri, 12-Mar-21", "2021-03-12"), ("12.03.2021 14:05", "2021-03-12T14:05"),
     ("3/13/21 2:05 pm", "2021-03-13T14:05"),
     ("3/13/2021", "2021-03-13"), ("31.02.2021", "31.02.2021"), ("12:30", "12:30")],
)  # fmt: skip
def test_dates_as_they_are_written(text, iso):
    assert read_dates([text]).of(text) == iso


def test_one_date_tells_the_order_of_all():
    found = read_dates(["04/03/2021", "2020-01-05", "04/13/2021"])
    assert found.of("04/03/2021") == "2021-04-03" and "month first" in found.notes[0]
    assert read_dates(["04/03/2021"], "dmy").of("04/03/2021") == "2021-03-04"
    serial = datetime.date(1899, 12, 30) + datetime.timedelta(days=44267)
    assert read_dates(["44267"]).of("44267") == serial.isoformat() and day_of("2021-03") == day_of("2021-03-15")


@pytest.mark.parametrize(
    ("text", "label"), [("Leg 3", "3"), ("actuator_4", "4"), ("L5", "5"), ("strut C", "C"), ("12", "")]
)
def test_labels_of_struts(text, label):
    assert strut_label(text) == label
