"""The commands on measurements: reduce, compare, diagnose, update, plan."""

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import toolpath_stiff as tps
from toolpath_stiff.cli import run
from toolpath_stiff.cli.parser import DATA, FILES, FOLDER, JSON, NO_PLOTS, REPLACE, command
from toolpath_stiff.errors import InputError
from toolpath_stiff.options import Option
from toolpath_stiff.workbooks import split_name


@command("reduce", "Measurements.read", REPLACE, NO_PLOTS, JSON)
def reduce(
    args: Namespace,
    raw: Annotated[Sequence[str], Option("RAW", count="+")],
    compression_positive: Annotated[bool, Option("--compression-positive")] = False,
    out: Annotated[str | None, Option("--out", "FILE")] = None,
) -> int:
    """Raw force and displacement records to measured stiffnesses, lost motion, loops.

    columns of RAW:
      x_mm,y_mm,z_mm,direction     where and along what (X, Y, Z; or dx,dy,dz), optionally a_deg,b_deg,c_deg
      jog_um                       how far the machine was told to move from zero
      force_N,displacement_um      gauge and indicator, positive the way the jog counts
      date                         2024-03-31, 2024-03-31T14:05; each date is a loop of its own
      point,setup,clamp,repeat,loop,tool_extension_mm,time_min,temperature_C   optional, carried along
    of a strut alone on a bench:   strut (1 to 6), date, force_N, displacement_um; length_mm if known; no pose,
                                   no jog; or strut, date, stiffness_N_per_mm of struts that were reduced elsewhere
    Other names, units and forms of dates are said by a mapping, also kept as RAW.columns.toml (force = "Kraft:kN"):
      tps reduce RAW --columns "strut=hp, date=day_ms:ms, stiffness=stiff_mean:N/um"
      tps reduce RAW --columns "strut==3, date=Datum:DD.MM.YYYY, force=Kraft:kN, displacement=Weg:mm"

    Records in the order taken, jogging 0, +200, -200, 0 um as ASME B5.54 and the paper do; those of one point,
    direction, set-up, clamping and repeat are one loop. Its stiffness is the secant between the extremes (the paper's
    equation 12); on a bench, force over displacement between the extremes of the force, tension and stretch positive.
    Struts measured on several dates: which of them changed, and when.

    Parameters
    ----------
    raw
        Raw records: files, FILE.xlsx[#SHEET].
    compression_positive
        Forces of struts on a bench are positive in compression.
    out
        File to write (default: <first RAW>_measurements.csv); loops go beside it.
    """
    reduction = tps.reduce(*raw, columns=args.columns, compression_positive=compression_positive)
    target = Path(out or f"{Path(split_name(raw[0])[0]).stem}_measurements.csv")
    written = [str(file) for file in run.write_single(args, reduction.files(target, plots=not args.no_plots))]
    run.tell("read", reduction.read_as)
    run.tell("note", reduction.notes)
    document = {**reduction.to_dict(), "files": written}
    return run.show(args, reduction, f"\nwrote {' and '.join(written)}", document=lambda: document)


@command("compare", DATA, "Machine.load", "compare", "compare_walls", "Program.read", *FOLDER)
def compare(args: Namespace) -> int:
    """Where the model fails: errors, structure in the residuals, pictures, page.

    for example:
      tps compare nist-table1
      tps compare measurements.csv --machine my_machine.toml
      tps compare first.csv second.csv --noise 2,1 --out reports/again
      tps compare points.csv --program part.nc --cut cut.toml        measured walls of a part

    The machine file is compared as it stands; `tps diagnose` asks which effect it lacks. A finding is a pattern in the
    residuals that fewer than 5 % of campaigns of mere scatter would show anywhere among all patterns looked for.
    Files written to --out: compare.json, residuals.csv, report.html, measured_modelled.png, machine.png,
    variables.png. With --cut DATA are points of a part's walls, and compare.json and residuals.csv are written.
    """
    if args.cut or args.material or args.stock_mm:
        if len(args.data) != 1:
            raise InputError("several files of measured walls", expected="a file")
        return run.to_folder(args, tps.compare_walls, tps.WallComparison, args.data, data=args.data[0])
    return run.to_folder(args, tps.compare, tps.Comparison, args.data)


@command("diagnose", DATA, "Machine.load", "Machine.under", "diagnose", "Program.read", *FOLDER)
def diagnose(args: Namespace) -> int:
    """Which physical effect the model lacks, if any. Any verdict is success.

    for example:
      tps diagnose measurements.csv
      tps diagnose nist-table1 --noise 5
      tps diagnose first.csv second.csv --effects my_effect.py --out reports/again

    The verdict: adequate (nothing is missing that these data could show), identified, described (by an effect whose
    form was read off these very readings), ambiguous (several explain the data equally well), unexplained (something is
    missing that no effect of the catalogue describes). Files written to --out: diagnose.json, residuals.csv,
    ladder.png, portrait.png, before_after.png, report.html.
    """
    return run.to_folder(args, tps.diagnose, tps.Diagnosis, args.data)


@command("update", DATA, "Machine.load", "update", *FOLDER)
def update(
    args: Namespace,
    output: Annotated[str | None, Option("-o --output", "MACHINE.toml")] = None,
) -> int:
    """Fit effects to measurements, see how far the error falls, write the machine file.

    for example:
      tps update measurements.csv --add joint_compliance -o fitted.toml
      tps update measurements.csv --add weak_strut:strut=3 --keep-strut-law
      tps update measurements.csv --auto
      tps update nist-table1 --strut-law --objective mean-error     the paper's own estimation

    An effect that the data do not support is refused, with the reason, unless --force is given; the exit code is 0 all
    the same. Files written to --out: update.json, residuals.csv, machine.toml (unless refused or -o names another
    place), before_after.png, report.html.

    Parameters
    ----------
    output
        The new machine file (default: in --out).
    """
    args.replace |= args.force
    run.check_single(args, output)
    folder, rules = run.destination(args, tps.Update, args.data, () if output is None else ("machine.toml",))
    fitted = run.call(args, tps.update, machine_file=output or folder / "machine.toml")
    written = fitted.save(folder, plots=not args.no_plots, rules=rules, machine=output is None)
    if output and fitted.accepted:
        written += run.write_single(args, {Path(output): fitted.machine_text()})
    return run.show(args, fitted, run.written_text(written), *(["", *fitted.next] if fitted.next else []))


@command("plan", "Machine.load", "plan", *FOLDER)
def plan(
    args: Namespace,
    data: Annotated[Sequence[str], Option("DATA", count="*", help=f"{FILES}; none: a first campaign")] = (),
) -> int:
    """What to measure next to tell explanations apart, or a first campaign.

    for example:
      tps plan measurements.csv                       what would tell the plausible explanations apart
      tps plan measurements.csv --between frame_compliance,joint_moment_stiffness --n 4
      tps plan measurements.csv first.csv --n 1       at the machine: where to go after the readings so far
      tps plan --machine nist                         a good first campaign
      tps plan --machine nist --between spindle_compliance,table_compliance

    Files written to --out: plan.csv (a measurement file with the stiffness left empty), plan.json and plan.png.
    """
    return run.to_folder(args, tps.plan, tps.Plan, data or [args.machine], minutes=dict(args.minutes or ()))


@command("forces", "forces", *FOLDER)
def forces(args: Namespace, records: Annotated[Sequence[str], Option("RECORDS", count="+")]) -> int:
    """Coefficients of the cutting force from dynamometer records of slots.

    columns of RECORDS, a row per moment:
      time_s, fx_N, fy_N, fz_N     what the dynamometer reads: forces on the work; fx and fz may lack
      feed_per_tooth_mm            or feed_mm_per_min; the same in all rows of a record, as are
      spindle_rpm, depth_mm        speed and depth of the slot
      record                       tells several records of a file apart
    Other names and units are said by a mapping, also kept as RECORDS.columns.toml; "==" is one value for all rows:
      tps forces s1.csv s2.csv s3.csv --cut cut.toml --columns "fx=Kraft X:kN, spindle_rpm==6000, depth==3"

    Slots of full width at three feeds or more, best five, with air before and after the cut. Whole turns are averaged,
    so that run-out cancels; the zero is a line through the air. What comes out goes into a setup file as
    [coefficients] with file = "forces.json". Files written to --out: forces.json, forces.csv, forces.png.

    Parameters
    ----------
    records
        Records: files, FILE.xlsx[#SHEET].
    """
    return run.to_folder(args, tps.forces, tps.CoefficientFit, records, records=records)
