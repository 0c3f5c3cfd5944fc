"""`tps analyze` of many programs: in parallel processes, one overview of all, failures named at the end."""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.cli.analyze import BELOW_REQUIRED, analysis_of
from toolpath_stiff.cli.arguments import machine_for, program_for
from toolpath_stiff.cli.outputs import Destination, inputs_of
from toolpath_stiff.cli.programs import FolderCount, Found, Listed, report_folders
from toolpath_stiff.cli.progress import say
from toolpath_stiff.cli.workers import answers, one_thread
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.report.batch import files, names, text
from toolpath_stiff.report.batch.outcome import Outcome, figures_of
from toolpath_stiff.report.words import plain
from toolpath_stiff.results_folder import STAGE, Rules

if TYPE_CHECKING:
    from toolpath_stiff.api.inputs import Machine

INCOMPLETE = 1  # exit code: a program failed, or samples were left out


@dataclass(frozen=True)
class Setting:
    """What every process needs to know: the arguments, and where the reports go."""

    args: argparse.Namespace
    out: Path
    rules: Rules

    def target(self, folder: Path | None = None) -> Destination:
        """Where the overview goes, or the report of a program."""
        return Destination(self.out if folder is None else self.out / folder, "analyze", self.rules)


def run_batch(args: argparse.Namespace, found: Sequence[Found], counts: Sequence[FolderCount], jobs: int) -> int:
    """Analyze the programs, `jobs` at a time, write the overview, print; the exit code.

    Raises
    ------
    InputError
        An argument is wrong; nothing has been started then.
    """
    one_thread()
    inputs = (*(one.file for one in found), *inputs_of(args))
    setting = Setting(args, Path(args.out or "reports"), Rules(inputs=inputs, replace=args.replace))
    programs = report_folders(found)
    _check(setting, found[0].file)
    if not args.json:
        for count in counts:
            print(plain(str(count)), flush=True)
    with _folders_for(setting.out, programs):
        outcomes = _outcomes(programs, setting, jobs)
        written = setting.target().write(files(outcomes))
    if args.json:
        _print_json(setting.out, programs, outcomes)
    else:
        print(text(outcomes))
        print("\n".join(["written:", *(f"  {plain(str(path))}" for path in written)]))
    if any(one.status != "done" for one in outcomes):
        return INCOMPLETE
    return BELOW_REQUIRED if any((one.figures or {}).get("lines_below_required") for one in outcomes) else 0


def _check(setting: Setting, first: str) -> None:
    """Read everything that all programs share once, so that a mistake in it is one error. Raises `InputError`."""
    from toolpath_stiff.nc.linuxcnc.runner import find_rs274

    machine = machine_for(setting.args)
    other = [machine.like(setting.args.compare)] if setting.args.compare else []
    machine.running(program_for(setting.args, first), other)
    if setting.args.interpreter == "linuxcnc":
        find_rs274(setting.args.rs274)
    setting.target().check(names())


@contextmanager
def _folders_for(out: Path, programs: Sequence[Listed]) -> Iterator[None]:
    """Make the folders above the reports, for all processes; those that stay empty are taken away at the end."""
    wanted = {out, *((out / program.folder).parent for program in programs)}
    above = {folder for place in wanted for folder in (place, *place.parents)}
    made = sorted((folder for folder in above if not folder.exists()), key=lambda folder: len(folder.parts))
    try:
        _make(made)
        yield
    finally:
        for folder in reversed(made):
            with suppress(OSError):  # not empty, the usual case
                folder.rmdir()


def _make(folders: Sequence[Path]) -> None:
    for folder in folders:
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot write to {str(folder)!r}: {error.strerror}") from None


def _outcomes(programs: Sequence[Listed], setting: Setting, jobs: int) -> list[Outcome]:
    """What became of each program, in the order given."""

    def died(program: Listed, process: int, how: str) -> Outcome:
        _sweep(setting.out / program.folder, process)
        return Outcome(program.name, program.file, f"{program.file}: {how}")

    # The largest first, so that no process is left alone with one at the end.
    order = sorted(range(len(programs)), key=lambda i: -_size(programs[i].file)) if jobs > 1 else range(len(programs))
    outcomes: list[Outcome | None] = [None] * len(programs)
    done = 0
    try:
        say(f"0/{len(programs)} programs, {jobs} at a time")
        for place, outcome in answers([programs[i] for i in order], partial(start_worker, setting), died, jobs):
            outcomes[order[place]] = outcome
            done += 1
            say(f"{done}/{len(programs)} programs, {plain(outcome.name)}{': failed' if outcome.reason else ''}")
    finally:
        say("")
    return [one for one in outcomes if one is not None]


def _size(file: str) -> int:
    try:
        return Path(file).stat().st_size
    except OSError:  # it fails later, with a better message
        return 0


def _sweep(folder: Path, process: int) -> None:
    """Remove what a process that died was writing."""
    for place in (folder, folder.parent):
        for left in place.glob(f"{STAGE.format(process=process)}*"):
            shutil.rmtree(left, ignore_errors=True)


def start_worker(setting: Setting) -> Callable[[Listed], Outcome]:
    """What a process does with each program; the machines are loaded once."""
    machine = machine_for(setting.args)

    def work(program: Listed) -> Outcome:
        return _analyze(setting, program, machine)

    return work


def _analyze(setting: Setting, program: Listed, machine: Machine) -> Outcome:
    args, target = setting.args, setting.target(program.folder)
    try:
        found = analysis_of(args, program.file, machine)
        found.save(
            target.folder,
            plots=not args.no_plots,
            rules=target.rules,
            table=args.format,
            show_plunges=args.show_plunges,
        )
    except TpsError as error:
        return Outcome(program.name, program.file, _reason(program, str(error)))
    except MemoryError:
        return Outcome(program.name, program.file, f"{program.file}: out of memory; try fewer --jobs")
    except Exception as error:  # a defect of ours: it must not stop the other programs
        told = " ".join(f"{type(error).__name__}: {error}".split())
        return Outcome(program.name, program.file, f"{program.file}: {told} (a defect; analyze it alone to see where)")
    opens = "summary.json" if setting.args.no_plots else "report.html"
    return Outcome(program.name, program.file, "", (program.folder / opens).as_posix(), figures_of(found.to_dict()))


def _reason(program: Listed, message: str) -> str:
    """The message in one line, beginning with the file as named: errors know its last name alone."""
    line = "; ".join(message.splitlines())
    last = Path(program.file).name
    if line.startswith(f"{last}:"):
        return program.file + line[len(last) :]
    return line if program.file in line else f"{program.file}: {line}"


def _print_json(out: Path, programs: Sequence[Listed], outcomes: Sequence[Outcome]) -> None:
    """The summaries one by one, from their files: together they may be large."""
    for i, (program, outcome) in enumerate(zip(programs, outcomes, strict=True)):
        if outcome.reason:
            entry = {"program": Path(program.file).name, "file": program.file, "error": outcome.reason}
        else:
            summary = json.loads((out / program.folder / "summary.json").read_text(encoding="utf-8"))
            entry = {**summary, "file": program.file, "report": str(out / outcome.opens)}
        sys.stdout.write(("[\n" if i == 0 else ",\n") + textwrap.indent(json.dumps(entry, indent=2), "  "))
    sys.stdout.write("\n]\n")
