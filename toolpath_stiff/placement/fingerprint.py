"""What a search was of: kept in `placement.json`, so that a later `--pick` is refused where anything has changed."""

from __future__ import annotations

import hashlib
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from toolpath_stiff.errors import InputError
from toolpath_stiff.machine.writer import machine_toml
from toolpath_stiff.units import mm_from_m

if TYPE_CHECKING:
    from toolpath_stiff.placement.placing import Task


def fingerprint(task: Task) -> dict[str, Any]:
    """Hashes of program and machine, and the options that a search depends on, under their names."""
    program, rules, bounds = task.program, task.rules, task.bounds
    moves = [getattr(program.moves, f.name).tobytes() for f in fields(program.moves)]
    acting = [(active.effect.name, sorted(active.values.items())) for active in task.model.effects]
    acting_in = f"{acting!r} {task.model.conditions!r}"
    low, high = bounds.low.tolist(), bounds.high.tolist()
    return {
        "program_sha256": _hash("\n".join(program.source).encode("utf-8", "replace"), *moves),
        "machine_sha256": _hash(machine_toml(task.model.machine).encode(), acting_in.encode()),
        "options": {
            **{f"--{name}": [low[i], high[i]] for i, name in enumerate(("x", "y", "z", "tilt-a", "tilt-b", "rotate"))},
            "--z-values": list(bounds.heights),
            "--keep-out": [[box.name, *box.low, *box.high] for box in rules.keepouts],
            "--objective": rules.objective,
            "--margin": rules.margin,
            "--allow-extrapolation": rules.allow_extrapolation,
            "--points": rules.points,
            "--seed": rules.seed,
            "--origin": list(task.present),
            "--load": str(task.load),
            "--step": mm_from_m(task.step),
            "--force": task.force,
        },
    }


def refuse_other_search(task: Task, earlier: dict[str, Any]) -> None:
    """Raise `InputError` where an earlier search was not of this program, machine and options; names what differs."""
    now, then = fingerprint(task), earlier.get("search")
    if not isinstance(then, dict) or "front" not in earlier:
        raise InputError("--pick: placement.json is of an older version", hint="search again, without --pick")
    differ = [name for name in ("program", "machine") if now[f"{name}_sha256"] != then.get(f"{name}_sha256")]
    options = then.get("options", {})
    differ += [name for name, value in now["options"].items() if options.get(name) != value]
    if differ:
        raise InputError(
            f"--pick: the earlier search differs in {', '.join(differ)}",
            expected="the same program, machine and options as in the search",
            hint="repeat the search's own command with --pick added, or search again without it",
        )


def _hash(*parts: bytes) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()
