"""The files of own effects that this user agreed to run: kept by their SHA-256, outside the cases that hold them.

A case may come from anybody, and its effect files are code. Nothing in a case can say that its code is harmless, so the
record stands in the user's configuration folder, a file a sum.
"""

import hashlib
import os
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file, write_atomically

FOLDER = "tps/agreed-effects"


def _record(content: bytes) -> Path:
    """Where it is recorded that this user agreed to the content of a file."""
    chosen = Path(os.environ.get("XDG_CONFIG_HOME", ""))  # a relative one does not count (XDG base directories)
    base = chosen if chosen.is_absolute() else Path.home() / ".config"
    if not base.is_absolute():  # it would lie in whatever folder is the present one, as a case that brings its own
        raise InputError("this user has no home folder", hint="set XDG_CONFIG_HOME to a folder of yours")
    return base / FOLDER / hashlib.sha256(content).hexdigest()


def is_agreed(content: bytes) -> bool:
    """Whether this user agreed to run a file of this content."""
    return is_file(_record(content))


def agree(content: bytes, name: str) -> None:
    """Record that this user runs a file of this content; `name` is for whoever reads the record.

    Raises `InputError` where the configuration folder cannot be written.
    """
    write_atomically(_record(content), f"{name}\n")
