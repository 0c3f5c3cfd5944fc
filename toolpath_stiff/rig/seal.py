"""The sealed truth: opaque to a look into the file, and tampering is noticed. It is no cryptography.

The key stands below, so whoever wants to cheat can; the seal keeps an honest user from reading the answer by
accident. The truth is written as JSON, compressed, padded to one length (so that the size tells nothing), scrambled
with a SHA-256 key stream and preceded by a keyed digest.
"""

from __future__ import annotations

import dataclasses
import hashlib
import hmac
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from toolpath_stiff.errors import InputError
from toolpath_stiff.rig.case import Case
from toolpath_stiff.rig.hidden import HiddenMachine
from toolpath_stiff.rig.noise import Nuisances
from toolpath_stiff.rig.nominal import parse_nominal
from toolpath_stiff.rig.outside import OUTSIDE, Oddity

MAGIC = b"tps-rig-sealed-1\n"
KEY = b"toolpath_stiff.rig: not a secret, only a blindfold"
DIGEST = hashlib.sha256().digest_size
BLOCK = 8192  # bytes; several times what one case needs


def seal(case: Case, seed: int, layout: str) -> bytes:
    """Content of `sealed.bin`; the same case gives the same bytes."""
    machine = {
        field.name: value.tolist() if isinstance(value := getattr(case.machine, field.name), np.ndarray) else value
        for field in dataclasses.fields(case.machine)
    }
    if case.machine.oddity is not None:
        machine["oddity"] = dataclasses.asdict(case.machine.oddity)
    content = {
        "seed": seed,
        "layout": layout,
        "truth": case.truth,
        "machine": machine,
        "nuisances": dataclasses.asdict(case.nuisances),
        "nominal": {"name": case.nominal.name, "text": case.nominal.text},
        "columns": list(case.rows),
        "clamps": int(max(case.rows.get("clamp", [0]))),
    }
    packed = zlib.compress(json.dumps(content, sort_keys=True).encode(), 9)
    length = len(packed).to_bytes(4, "big")
    body = (length + packed).ljust(-(-(len(packed) + 4) // BLOCK) * BLOCK, b"\0")
    digest = hmac.digest(KEY, body, "sha256")
    return MAGIC + digest + _scrambled(body, digest)


def unseal(file: str | Path) -> tuple[Case, dict[str, Any]]:
    """The case (without its rows) and what else was sealed. Raises `InputError` if the file was changed."""
    try:
        content = Path(file).read_bytes()
    except OSError as error:
        raise InputError(
            f"cannot read {str(file)!r}: {error.strerror}", hint="give the folder that `tps rig new` wrote"
        ) from None
    digest = content[len(MAGIC) : len(MAGIC) + DIGEST]
    body = _scrambled(content[len(MAGIC) + DIGEST :], digest)
    if not content.startswith(MAGIC) or not hmac.compare_digest(digest, hmac.digest(KEY, body, "sha256")):
        raise InputError(
            "the seal is broken: the file was changed or is no sealed truth",
            hint="make the exercise anew with `tps rig new`",
            file=str(file),
        )
    sealed: dict[str, Any] = json.loads(zlib.decompress(body[4 : 4 + int.from_bytes(body[:4], "big")]))
    machine: dict[str, Any] = {k: np.array(v) if isinstance(v, list) else v for k, v in sealed["machine"].items()}
    machine["spindle"] = tuple(sealed["machine"]["spindle"])
    if sealed["machine"]["oddity"] is not None:
        machine["oddity"] = Oddity(**sealed["machine"]["oddity"])
    nominal = parse_nominal(sealed["nominal"]["text"], sealed["nominal"]["name"])
    case = Case({}, sealed["truth"], nominal, HiddenMachine(**machine), Nuisances(**sealed["nuisances"]))
    return case, sealed


def _scrambled(body: bytes, nonce: bytes) -> bytes:
    """The body, every byte exclusive-or with a key stream; its own inverse."""
    count = -(-len(body) // DIGEST)
    stream = b"".join(hashlib.sha256(KEY + nonce + i.to_bytes(4, "big")).digest() for i in range(count))
    return bytes(a ^ b for a, b in zip(body, stream, strict=False))


def score(hidden: list[str], claim: list[str]) -> str:
    """`right`, `partly`, `wrong` or `correctly none`.

    Nothing hidden is claimed as `none` or `adequate`; something outside the catalogue as `outside` or `unexplained`,
    or by its own name.
    """
    claimed = {name for name in claim if name not in ("none", "adequate")}
    truth = set(hidden)
    if claimed & {"outside", "unexplained"}:
        claimed = (claimed - {"outside", "unexplained"}) | ((truth & set(OUTSIDE)) or {"outside"})
    if not truth:
        return "wrong" if claimed else "correctly none"
    if claimed == truth:
        return "right"
    return "partly" if claimed & truth else "wrong"
