"""Files that are whole or not there: write to a temporary name beside the target, then rename."""

from __future__ import annotations

import itertools
import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from toolpath_stiff.errors import FileError

NOT_WINDOWS = frozenset(b"\x81\x8d\x8f\x90\x9d")  # bytes that Windows' Latin-1 (cp1252) leaves undefined

Content = str | bytes | Iterable[str | bytes]


def write_atomically(path: str | Path, content: Content) -> Path:
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
                stream.writelines(encoded(content))
        else:
            _write_then_rename(target.resolve(), content)
    except OSError as error:
        raise FileError(f"cannot write {str(path)!r}: {error.strerror}") from None
    return target


def _write_then_rename(target: Path, content: Content) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.writelines(encoded(content))
        Path(temporary).chmod(0o666 & ~_umask())
        Path(temporary).replace(target)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def encoded(content: Content) -> Iterator[bytes]:
    """The content as bytes, piece by piece: text as UTF-8."""
    if isinstance(content, bytes):
        yield content
    else:
        for piece in [content] if isinstance(content, str) else content:
            yield piece.encode("utf-8", "replace") if isinstance(piece, str) else piece


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


def read_bytes(path: str | Path, what: str) -> bytes:
    """Content of a file; `what` names it in messages. Raises `InputError`."""
    try:
        return Path(path).read_bytes()
    except OSError as error:
        raise FileError(f"cannot read {what} {str(path)!r}: {error.strerror}") from None


def decoded(content: bytes) -> str:
    """Text of bytes: UTF-16 (told by its byte-order mark or its zeros), UTF-8 or, failing that, Windows' Latin-1."""
    start = content[:400]
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", "replace")
    for encoding, zeros in (("utf-16-le", start[1::2]), ("utf-16-be", start[::2])):
        if zeros and zeros.count(0) > 0.8 * len(zeros):
            return content.decode(encoding, "replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252") if not set(content) & NOT_WINDOWS else content.decode("latin-1")


def read_text(path: str | Path, what: str) -> str:
    """Text of a file in any of these encodings; `what` names it in messages. Raises `InputError`."""
    return decoded(read_bytes(path, what))


def check_outputs(outputs: Iterable[str | Path], inputs: Iterable[str | Path], replace: bool = False) -> list[Path]:
    """The outputs that are an input as well: the same file, by another name or through a link.

    Raises `InputError` for the first of them unless `replace`.
    """
    given = [Path(file) for file in inputs if Path(file).is_file()]
    found = [Path(out) for out in outputs if any(_is_same(Path(out), file) for file in given)]
    if found and not replace:
        raise FileError(
            f"{str(found[0])!r} is read here and would be written over",
            hint="write somewhere else, or say --replace: the old file is then kept beside the new one",
        )
    return found


def _is_same(out: Path, file: Path) -> bool:
    try:
        return out.samefile(file)
    except OSError:  # one of them is not there
        return False


def keep_old(file: str | Path) -> Path | None:
    """Copy a file to a free name beside it, `NAME.old` or `NAME.old2` and so on; None where there is no file.

    Raises `InputError` where that cannot be done.
    """
    path = Path(file)
    if not path.is_file():
        return None
    numbers = itertools.chain([""], itertools.count(2))
    names = (path.with_name(f"{path.name}.old{number}") for number in numbers)
    kept = next(name for name in names if not name.exists() and not name.is_symlink())
    try:
        return write_atomically(kept, path.read_bytes())
    except OSError as error:
        raise FileError(f"cannot read {str(path)!r}: {error.strerror}") from None
