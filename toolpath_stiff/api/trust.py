"""Effect files of one's own that the user has agreed to run: recorded by SHA-256, outside any case.

A case may come from anybody, and its effect files are code. Nothing in a case can say that its code is harmless, so the
record stands in the user's configuration folder, a file per sum.
"""

import hashlib
import os
from pathlib import Path

from toolpath_stiff.errors import InputError
from toolpath_stiff.files import is_file, write_atomically

FOLDER = "tps/agreed-effects"


def _record(content: bytes) -> Path:
    """File that records this user's agreement to the content of a file."""
    chosen = Path(os.environ.get("XDG_CONFIG_HOME", ""))  # a relative path is ignored (XDG base directories)
    base = chosen if chosen.is_absolute() else Path.home() / ".config"
    if not base.is_absolute():  # it would lie in the present folder, possibly one that a case brings along
        raise InputError("this user has no home folder", hint="set XDG_CONFIG_HOME to a folder of yours")
    return base / FOLDER / hashlib.sha256(content).hexdigest()


def is_agreed(content: bytes) -> bool:
    """True if this user has agreed to run a file with this content."""
    return is_file(_record(content))


def agree(content: bytes, name: str) -> None:
    """Record that this user runs a file with this content; `name` is for people who read the record.

    Raises `InputError` where the configuration folder cannot be written.
    """
    write_atomically(_record(content), f"{name}\n")
