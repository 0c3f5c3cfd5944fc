"""`tps diagnose`: the physical effect that the model lacks, if any."""

from __future__ import annotations

import argparse
import json
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import (
    add_condition_options,
    add_program_options,
    asked_setup,
    limit_threads,
    read_program_for,
)
from toolpath_stiff.cli.measurement_arguments import (
    add_data_arguments,
    add_noise_arguments,
    add_output_arguments,
    asked,
    check_seed,
)
from toolpath_stiff.cli.outputs import destination
from toolpath_stiff.cli.progress import say
from toolpath_stiff.files import Content

if TYPE_CHECKING:
    from toolpath_stiff.machine import Machine
    from toolpath_stiff.nc import Program
    from toolpath_stiff.updating.diagnosis import Diagnosis

EPILOG = """\
examples:
  tps diagnose measurements.csv
  tps diagnose nist-table1 --noise 5
  tps diagnose first.csv second.csv --effects my_effect.py --out reports/again

The verdict: adequate (nothing is missing that these data could show), identified, ambiguous (several explain the data
equally well), unexplained (something is missing that no effect of the catalogue describes). Files written to --out:
diagnose.json, residuals.csv, ladder.png, confounding.png, detectable.png, before_after.png, envelope.png,
report.html.
"""

DATA = ("diagnose.json", "residuals.csv")
PICTURES = (
    "ladder.png", "confounding.png", "detectable.png", "before_after.png", "envelope.png", "report.html",
)  # fmt: skip


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    add_data_arguments(parser)
    add_noise_arguments(parser)
    group = parser.add_argument_group("how much the choice matters")
    group.add_argument(
        "--program", metavar="PROGRAM", help="NC program to try it on (default: the packaged case study)"
    )
    add_condition_options(group)
    add_program_options(parser, sampled=False)
    add_output_arguments(parser, "diagnose", kept="diagnose.json and residuals.csv")


def run(args: argparse.Namespace) -> int:
    """Diagnose, write, say what was found. Any verdict is success."""
    check_seed(args.seed)
    target = destination(args, "diagnose", args.data, "-diagnose").check(DATA if args.no_plots else (*DATA, *PICTURES))
    limit_threads(args.jobs)
    from toolpath_stiff.machine import load_machine
    from toolpath_stiff.updating.diagnosis import diagnose
    from toolpath_stiff.updating.diagnosis.document import document
    from toolpath_stiff.updating.measurements import read_measurements

    machine = load_machine(args.machine)
    data = read_measurements(args.data, machine)
    diagnosis = diagnose(
        machine, data, noise=args.noise, strut_spread=args.strut_spread, effect_files=args.effects, seed=args.seed,
        program=lambda: _program(args, machine), origin=args.origin, setup=asked_setup(args),
        temperature=args.temperature, files=args.data, command=args.command_line, asked=asked(args), progress=say,
    )  # fmt: skip
    found = document(diagnosis)
    contents: dict[str, Content] = {
        "diagnose.json": json.dumps(found, indent=2, ensure_ascii=False) + "\n",
        "residuals.csv": _residuals(diagnosis),
    }
    if not args.no_plots:
        say("drawing")
        contents |= _pictures(found, diagnosis)
    say("")
    written = target.write(contents)
    if args.json:
        print(contents["diagnose.json"], end="")
    else:
        from toolpath_stiff.report.diagnose_text import terminal_text

        print(terminal_text(found))
        print("\n".join(["written:", *(f"  {file}" for file in written)]))
    return 0


def _program(args: argparse.Namespace, machine: Machine) -> Program:
    """The program that the choice between explanations is tried on."""
    from toolpath_stiff.placement.case_study import case_study_program

    return case_study_program() if args.program is None else read_program_for(args, args.program, machine)


def _residuals(diagnosis: Diagnosis) -> str:
    """One row a reading: measured, modelled as given, with the law refitted, with the best explanation."""
    import numpy as np

    from toolpath_stiff.units import deg_from_rad, mm_from_m, n_per_mm_from_n_per_m
    from toolpath_stiff.updating.inference.fits import deviation_percent

    data = diagnosis.data
    lines = [
        "file,line,point,x_mm,y_mm,z_mm,a_deg,b_deg,c_deg,dx,dy,dz,stiffness_N_per_mm,as_given_N_per_mm,"
        "law_refitted_N_per_mm,after_N_per_mm,as_given_deviation_percent,law_refitted_deviation_percent,"
        "after_deviation_percent"
    ]
    for i in range(len(data)):
        pose = [*mm_from_m(data.position[i]), *deg_from_rad(data.angles[i]), *data.direction[i]]
        measured = float(n_per_mm_from_n_per_m(data.stiffness[i]))
        own = [float(r[i]) for r in (diagnosis.before, diagnosis.base.residual, diagnosis.after)]
        modelled = [measured * float(np.exp(-r)) for r in own]
        numbers = [f"{value:.6g}" for value in pose]
        numbers += [f"{value:.1f}" for value in (measured, *modelled)]
        numbers += [f"{float(deviation_percent(np.array(r))):.3f}" for r in own]
        name = '"' + str(data.file[i]).replace('"', '""') + '"'
        point = '"' + str(data.point[i]).replace('"', '""') + '"'
        lines.append(",".join([name, str(data.line[i]), point, *numbers]))
    return "\n".join(lines) + "\n"


def _pictures(found: dict[str, Any], diagnosis: Diagnosis) -> dict[str, Content]:
    from toolpath_stiff.report.diagnose_page import diagnose_html
    from toolpath_stiff.report.diagnose_pictures import confounding_png, detectable_png, envelope_png, ladder_png
    from toolpath_stiff.report.update_pictures import before_after_png

    pictures: dict[str, bytes | None] = {
        "ladder.png": ladder_png(found),
        "confounding.png": confounding_png(found),
        "detectable.png": detectable_png(found),
        "before_after.png": before_after_png(found, diagnosis.data, diagnosis.before, diagnosis.after),
        "envelope.png": envelope_png(found),
    }
    drawn = {name: picture for name, picture in pictures.items() if picture is not None}
    return {**drawn, "report.html": diagnose_html(found, drawn)}
