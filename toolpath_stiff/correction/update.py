"""A model corrected: what it lacks is added, fitted, judged, and written to a machine file with its origin."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from toolpath_stiff.correction.additions import parse_addition
from toolpath_stiff.correction.ladder import Update, build_ladder
from toolpath_stiff.correction.machines import data_hash
from toolpath_stiff.correction.strut_law import bar_curve, update_by_mean_error
from toolpath_stiff.defaults import STRUT_SPREAD
from toolpath_stiff.errors import InputError
from toolpath_stiff.hints import Asked, command_line, hint, options
from toolpath_stiff.machine.model import Machine
from toolpath_stiff.readings.measurements import Measurements
from toolpath_stiff.stiffness.model import build_model, setup_of

if TYPE_CHECKING:
    from toolpath_stiff.correction.strut_law import BarCurve, StrutLawSearch


LIKELIHOOD, MEAN_ERROR = OBJECTIVES = ("likelihood", "mean-error")


@dataclass(frozen=True)
class Correction:
    """What an update found, and the machine that came of it.

    Attributes
    ----------
    update
        Steps, and whether the data support them.
    machine
        The machine with what was added; None where nothing is to be written.
    provenance
        Where the fitted values come from, as the machine file has it.
    files, machine_file, seed
        Names of the measurement files; of the machine file that is written, None if there is none.
    next
        Commands that use the new machine.
    search, bars
        Of the paper's own estimation: how its searches ended; its Figure 3. None otherwise.
    """

    update: Update
    machine: Machine | None
    provenance: dict[str, Any]
    files: tuple[str, ...]
    machine_file: str | None
    seed: int
    next: tuple[str, ...] = ()
    search: StrutLawSearch | None = None
    bars: BarCurve | None = None


def update(
    machine: Machine,
    data: Measurements,
    add: Sequence[str] = (),
    *,
    strut_law: bool = False,
    keep_strut_law: bool = False,
    auto: bool = False,
    force: bool = False,
    objective: str = LIKELIHOOD,
    noise: float | tuple[float, float] | None = None,
    strut_spread: float = STRUT_SPREAD,
    effect_files: Sequence[str | Path] = (),
    seed: int = 0,
    files: Sequence[str] = (),
    machine_file: str = "machine.toml",
    asked: Asked | None = None,
    progress: Callable[[str], None] | None = None,
) -> Correction:
    """Fit effects to measurements, judge whether the data support them, and make the machine that carries them.

    Parameters
    ----------
    machine, data
        The model and n readings.
    add
        Effects to be added: `weak_strut`, or with what they act on, `weak_strut:strut=3`.
    strut_law
        Write the refitted strut law even if no effect is added.
    keep_strut_law
        Keep the strut law of the machine file; else its two stiffnesses are fitted along with every effect.
    auto
        Go on adding effects while the data support them.
    force
        Keep what the data do not support, or readings hardly of this machine; never what fits worse than `machine`.
    objective
        "likelihood"; or "mean-error", the paper's own estimation, of the strut law alone.
    noise, strut_spread, effect_files, seed, progress
        As in `diagnose`.
    files
        Names of the measurement files, whose bytes are hashed for the record; empty: those that `data` names.
    machine_file
        Name that the new machine file is to have, for the record and the commands that use it.
    asked
        What the commands that go on from here carry.

    Raises
    ------
    InputError
        Too few readings, an effect named twice or present already, unknown or without its column, nothing to do.

    Examples
    --------
    >>> from toolpath_stiff.machine.file import load_machine
    >>> from toolpath_stiff.readings.measurements import read_measurements
    >>> nist = load_machine("nist")
    >>> found = update(nist, read_measurements("nist-table1", nist), strut_law=True)
    >>> [f"{step.name}: {100 * step.error:.2f} %" for step in found.update.steps]
    ['as given: 9.62 %', 'strut law refitted: 9.72 %']
    """
    files = tuple(files) or tuple(dict.fromkeys(data.file.tolist()))
    asked = asked or Asked(files, machine.name, tuple(map(str, effect_files)), noise, strut_spread)
    flags = {"strut_law": strut_law, "keep_strut_law": keep_strut_law, "auto": auto, "force": force}
    search = None
    if objective == MEAN_ERROR:
        check_mean_error(add, strut_law, auto)
        found, search = update_by_mean_error(
            machine, data.of_tip, force=force, noise=noise, strut_spread=strut_spread, effect_files=effect_files,
            seed=seed, progress=progress,
        )  # fmt: skip
    else:
        found = build_ladder(
            machine, data, [parse_addition(text, data, effect_files) for text in add], strut_law=strut_law,
            keep_law=keep_strut_law, auto=auto, force=force, noise=noise, strut_spread=strut_spread,
            effect_files=effect_files, seed=seed, progress=progress,
        )  # fmt: skip
    # Where its results go does not matter to the command that repeats the fit.
    own = options(add=list(add), **flags, objective=objective if search is not None else None, seed=seed or None)
    provenance = _provenance(found, files, asked.command("update", *own))
    updated = found.fitted(provenance) if found.accepted else None
    return Correction(
        found,
        updated,
        provenance,
        files,
        machine_file if updated is not None else None,
        seed,
        () if updated is None else _next(updated, machine_file, asked, effect_files),
        search,
        None if search is None else _bars(machine, data, seed, progress),
    )


def check_mean_error(add: Sequence[str], strut_law: bool, auto: bool) -> None:
    """Raise `InputError` where the paper's own estimation is asked for more than it can do."""
    if add or auto or not strut_law:
        raise InputError(
            "--objective mean-error is the paper's own estimation, of the strut law alone",
            expected="--strut-law, without --add and --auto",
            hint="effects are fitted by likelihood",
        )


def _provenance(update: Update, files: Sequence[str], command: str) -> dict[str, Any]:
    """Where the fitted values come from. No date: the same data and command give the same bytes."""
    described = {} if update.described is None else {"described": f"not confirmed: {update.described.reason}"}
    return {
        **described,
        "data": list(files),
        "data_sha256": data_hash(files),
        "readings": len(update.data),
        "command": command,
        "noise": update.noise.origin,
        "mean_error_before_percent": round(100.0 * update.steps[0].error, 3),
        "mean_error_after_percent": round(100.0 * update.last.error, 3),
        "left_out_error_after_percent": round(100.0 * update.last.held.mean_error, 3),
    }


def _next(updated: Machine, machine_file: str, asked: Asked, effect_files: Sequence[str | Path]) -> tuple[str, ...]:
    """Commands that use the new machine; an effect that belongs to a set-up acts only where that is named."""
    model = build_model(updated, effect_files)
    setups = [name for active in model.effects if (name := setup_of(active))]
    shown = options(machine=machine_file, effects=list(effect_files), setup=setups[0] if setups else None)
    also = " (analyze, place and pose take the same options)"
    return (
        hint("what is left", asked.command("compare", machine=machine_file)),
        hint(f"the stiffness over the workspace{also}", command_line("map", *shown)),
    )


def _bars(machine: Machine, data: Measurements, seed: int, progress: Callable[[str], None] | None) -> BarCurve | None:
    """The paper's Figure 3; None where the machine carries bars as an effect."""
    if any(entry.name == "platform_flexibility" for entry in machine.effects):
        return None
    if progress is not None:
        progress("the platform's bars, soft to rigid")
    return bar_curve(machine, data, seed=seed, starts=1)
