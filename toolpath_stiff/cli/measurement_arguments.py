"""Arguments that the commands on measurements share: data, machine, how far readings scatter, what is written."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from toolpath_stiff.cli.arguments import add_json_option, finite_number
from toolpath_stiff.cli.outputs import add_replace_option
from toolpath_stiff.defaults import MACHINE, STRUT_SPREAD

if TYPE_CHECKING:
    from toolpath_stiff.api.inputs import Machine
    from toolpath_stiff.api.measuring import Measurements


def add_data_arguments(parser: argparse.ArgumentParser, nargs: str = "+", otherwise: str = "") -> None:
    """DATA, --machine and --effects."""
    parser.add_argument(
        "data",
        nargs=nargs,
        metavar="DATA",
        help="measurement files (CSV, or FILE.xlsx[#SHEET]), or nist-table1" + otherwise,
    )
    parser.add_argument(
        "--machine", default=MACHINE, metavar="NAME|FILE", help=f"machine name or file (default: {MACHINE})"
    )
    parser.add_argument(
        "--effects", action="append", default=[], metavar="FILE.py", help="your own physical effects; they take part"
    )


def add_noise_arguments(parser: argparse.ArgumentParser, guess: str = "a low and a high guess") -> None:
    """--noise and --strut-spread; `guess` is made where nothing is known."""
    group = parser.add_argument_group("noise")
    group.add_argument(
        "--noise", type=noise_argument, metavar="PERCENT[,PERCENT]",
        help="sd of one reading, re-clamping included; or of the reading alone and of a clamping "
        f"(default: from repeats, else from sd_N_per_mm, else {guess})",
    )  # fmt: skip
    group.add_argument(
        "--strut-spread", type=spread_argument, default=100.0 * STRUT_SPREAD, metavar="PERCENT",
        help="of the struts' stiffness (default: 1)",
    )  # fmt: skip


def add_output_arguments(
    parser: argparse.ArgumentParser, command: str, kept: str, *, force: bool = True, of: str = "DATA"
) -> None:
    """--seed, --jobs, --out, --replace (--force), --no-plots, --json; `kept` is what --no-plots writes still.

    `of` is what the folder is named after.
    """
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of every random draw (default: 0)")
    parser.add_argument("--jobs", type=int, default=1, metavar="N", help="threads (default: 1)")
    parser.add_argument("--out", metavar="DIR", help=f"folder (default: reports/<{of}>-{command})")
    add_replace_option(parser, force=force)
    parser.add_argument("--no-plots", action="store_true", help=f"only {kept}")
    add_json_option(parser, f"print {command}.json to standard output and nothing else")


def measured(args: argparse.Namespace) -> tuple[Machine, Measurements]:
    """The machine with its effect files, and the measurements."""
    from toolpath_stiff.api.inputs import Machine
    from toolpath_stiff.api.measuring import Measurements

    return Machine.load(args.machine, effects=args.effects), Measurements(args.data)


def noise_options(args: argparse.Namespace) -> dict[str, Any]:
    """--noise, --strut-spread and --seed, as every function on measurements takes them."""
    return {"noise_percent": args.noise, "strut_spread_percent": args.strut_spread, "seed": args.seed}


def noise_argument(text: str) -> float | tuple[float, float]:
    """One or two percentages."""
    parts = [finite_number(part) for part in text.split(",")]
    if len(parts) > 2 or not all(0.0 <= part <= 50.0 for part in parts) or parts[0] <= 0.0:
        raise argparse.ArgumentTypeError(f"{text!r}: expected one or two percentages, more than 0 and at most 50")
    return parts[0] if len(parts) == 1 else (parts[0], parts[1])


def spread_argument(text: str) -> float:
    """A percentage from 0 to 50."""
    value = finite_number(text)
    if not 0.0 <= value <= 50.0:
        raise argparse.ArgumentTypeError(f"{text} %: expected 0 to 50 %")
    return value
