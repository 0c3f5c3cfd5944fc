"""Files that are whole or not there: write to a temporary name beside the target, then rename."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from toolpath_stiff.errors import InputError


def write_atomically(path: str | Path, content: str | bytes | Iterable[str | bytes]) -> Path:
    """Write text (UTF-8, line feeds as they are), bytes or pieces of text; folders are made as needed.

    A symbolic link is followed. A device or pipe (`/dev/stdout`) is written to, never replaced by a file.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    target = Path(path)
    try:
        if target.exists() and not target.is_file() and not target.is_dir():
            with target.open("wb") as stream:
                stream.writelines(_encoded(content))
        else:
            _write_then_rename(target.resolve(), content)
    except OSError as error:
        raise InputError(f"cannot write {str(path)!r}: {error.strerror}") from None
    return target


def _write_then_rename(target: Path, content: str | bytes | Iterable[str | bytes]) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.writelines(_encoded(content))
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _encoded(content: str | bytes | Iterable[str | bytes]) -> Iterator[bytes]:
    if isinstance(content, bytes):
        yield content
    else:
        for piece in [content] if isinstance(content, str) else content:
            yield piece.encode("utf-8", "replace") if isinstance(piece, str) else piece


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def read_text(path: str | Path, what: str) -> str:
    """Text of a UTF-8 (or, failing that, Latin-1) file; `what` names it in messages. Raises `InputError`."""
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {what} {str(path)!r}: {error.strerror}") from None
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")
