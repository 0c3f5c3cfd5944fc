"""Files that are either complete or absent: written beside their place, flushed to the disk, then renamed."""

import errno
import filecmp
import itertools
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from toolpath_stiff.errors import InputError

LARGEST_BYTES = 1 << 30  # of a file that is read
BLOCK = 1 << 20  # bytes written at once

Content = str | bytes | Iterable[str | bytes]


@contextmanager
def writing_errors(path: str | Path, what: str = "write") -> Iterator[None]:
    """Turn an error of the operating system into an `InputError`."""
    try:
        yield
    except OSError as error:
        raise InputError(f"cannot {what} {str(path)!r}: {error.strerror or error}") from None


def write_atomically(path: str | Path, content: Content, keep: bool = False) -> Path:
    """Write text (UTF-8, line feeds unchanged), bytes or pieces of text; missing folders are made.

    A symbolic link is followed. A device or pipe (`/dev/stdout`) is written to, never replaced by a file. With `keep`
    an old file of other content is kept beside the new one, by its `old_name`.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    place, target = Path(path), Path(os.path.realpath(path))
    with writing_errors(path):
        if place.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if place.exists() and not place.is_file():
            with place.open("wb") as stream:
                stream.writelines(encoded(content))
            return place
        target.parent.mkdir(parents=True, exist_ok=True)
        part = target.with_name(f".tps-part-{os.urandom(4).hex()}")
        try:
            write_new(part, content)
            if keep and target.is_file() and not filecmp.cmp(part, target, shallow=False):
                write_atomically(old_name(place), read_bytes(target, "the old file"))
            part.replace(target)
        except BaseException:
            part.unlink(missing_ok=True)
            raise
    return place


def write_new(path: Path, content: Content) -> None:
    """Write a new file in a place that no other process reads, and flush it to the disk. Raises `OSError`."""
    with path.open("xb", buffering=BLOCK) as stream:
        stream.writelines(encoded(content))
        stream.flush()
        os.fsync(stream.fileno())


def encoded(content: Content) -> Iterator[bytes]:
    """The content as bytes, piece by piece: text as UTF-8."""
    for piece in [content] if isinstance(content, str | bytes) else content:
        yield piece.encode("utf-8", "replace") if isinstance(piece, str) else piece


def is_file(path: str | Path) -> bool:
    """True if the path is a file; False also for a name that cannot exist (too long, a loop of links)."""
    try:
        return Path(path).is_file()
    except OSError:
        return False


def read_bytes(path: str | Path, what: str, most: int = LARGEST_BYTES) -> bytes:
    """Content of a file of at most `most` bytes; `what` names it in messages. Raises `InputError`."""
    try:
        check_regular(Path(path), pipes=True)
        with Path(path).open("rb") as stream:
            content = stream.read(most + 1)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        raise InputError(f"cannot read {what} {str(path)!r}: {getattr(error, 'strerror', None) or error}") from None
    if len(content) > most:
        raise InputError(f"{what} {str(path)!r} has more than {most / 1e6:.0f} MB", hint="is it the right file?")
    return content


def read_utf8(path: str | Path, what: str, most: int = LARGEST_BYTES) -> str:
    """Text of a file in UTF-8, without its byte-order mark. Raises `InputError`."""
    try:
        return read_bytes(path, what, most).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{what} is not a text file", file=str(path)) from None


def check_regular(path: Path, pipes: bool = False) -> None:
    """Refuse files that may never end when read: a device, or a named pipe waiting for its writer.

    With `pipes`, those of the shell (`/dev/stdin`, `<(command)`) pass, as their writer is there. A folder passes: the
    system's own error says that it is one. Raises `OSError`.
    """
    mode = path.stat().st_mode
    shell = pipes and stat.S_ISFIFO(mode) and path.is_absolute() and path.parts[1] in ("dev", "proc")
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or shell):
        raise OSError(errno.EINVAL, "it is not a regular file")


def decoded(content: bytes) -> str:
    """Text of bytes: UTF-16 if they have its byte-order mark, otherwise UTF-8 or, failing that, Windows' Latin-1."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252", "replace")


def read_text(path: str | Path, what: str) -> str:
    """Text of a file in any encoding that `decoded` knows; `what` names it in messages. Raises `InputError`."""
    return decoded(read_bytes(path, what))


def check_outputs(outputs: Iterable[str | Path], inputs: Iterable[str | Path], replace: bool = False) -> list[Path]:
    """Outputs that are also inputs: the same file, under whatever name or link.

    Raises `InputError` for the first of them unless `replace`.
    """
    given = [Path(file) for file in inputs if is_file(file)]
    read = [Path(out) for out in outputs if is_file(out) and any(Path(out).samefile(file) for file in given)]
    if read and not replace:
        raise InputError(
            f"{str(read[0])!r} is read here and would be written over",
            hint="write somewhere else, or say --replace (replace=True): the old file is kept beside the new one",
        )
    return read


def old_name(file: Path) -> Path:
    """`NAME.old`, or `NAME.old2` and so on, whichever is free first."""
    names = (file.with_name(f"{file.name}.old{'' if number == 1 else number}") for number in itertools.count(1))
    return next(name for name in names if not os.path.lexists(name))
