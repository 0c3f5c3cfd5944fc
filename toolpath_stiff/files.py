"""Files that are whole or not there: written beside their place and flushed to the disk, then renamed."""

from __future__ import annotations

import errno
import itertools
import os
import stat
import sys
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from toolpath_stiff.errors import FileError
from toolpath_stiff.locks import beside, hold, is_at, reason, remove_parts, writing_errors

NOT_WINDOWS = frozenset(b"\x81\x8d\x8f\x90\x9d")  # bytes that Windows' Latin-1 (cp1252) leaves undefined
LARGEST_BYTES = 1 << 30  # of a file that is read
BLOCK = 1 << 20  # bytes written at once
NEW_FILE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)  # the last is Windows'
# renameat2(2); what says that this file system, or this folder, cannot be exchanged
AT_FDCWD, RENAME_EXCHANGE = -100, 2
NOT_EXCHANGED = (errno.ENOSYS, errno.EINVAL, errno.EOPNOTSUPP, errno.EPERM, errno.EACCES, errno.EBUSY, errno.EXDEV)

Content = str | bytes | Iterable[str | bytes]


def write_atomically(path: str | Path, content: Content) -> Path:
    """Write text (UTF-8, line feeds as they are), bytes or pieces of text; folders are made as needed.

    A symbolic link is followed. A device or pipe (`/dev/stdout`) is written to, never replaced by a file.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    with written_beside({path: content}) as put:
        put()
    return Path(path)


@contextmanager
def written_beside(contents: Mapping[str | Path, Content]) -> Iterator[Callable[[], None]]:
    """Write files beside their places; what is yielded puts all of them there. Rules and errors: `write_atomically`."""
    with ExitStack() as stack:
        steps = []
        for path, content in contents.items():
            with writing_errors(path):
                steps.append(stack.enter_context(_beside_its_place(Path(path), content)))

        def put() -> None:
            for path, step in zip(contents, steps, strict=True):
                with writing_errors(path):
                    step()

        yield put


@contextmanager
def _beside_its_place(path: Path, content: Content) -> Iterator[Callable[[], None]]:
    if path.exists() and not path.is_file() and not path.is_dir():

        def to_device() -> None:
            with path.open("wb") as stream:
                stream.writelines(encoded(content))

        yield to_device
        return
    target = Path(os.path.realpath(path))
    if target.is_symlink() or target.is_dir():  # realpath leaves nothing else a link
        code = errno.ELOOP if target.is_symlink() else errno.EISDIR
        raise OSError(code, os.strerror(code))
    target.parent.mkdir(parents=True, exist_ok=True)
    prefix = beside(target, "part-")
    remove_parts(prefix)
    handle, temporary = _new_file(prefix)
    with os.fdopen(handle, "wb") as held:
        try:
            _write(handle, content)
            yield lambda: _put(held, temporary, target)
        finally:
            if temporary.exists():
                with suppress(OSError):  # the next run takes it away
                    temporary.unlink()


def _put(held: BinaryIO, temporary: Path, target: Path) -> None:
    if sys.platform == "win32":  # where an open file cannot be renamed
        held.close()
    temporary.replace(target)
    sync_folder(target.parent)


def _new_file(prefix: Path) -> tuple[int, Path]:
    """An open file of a new name, held by this process."""
    while True:
        path = prefix.with_name(prefix.name + os.urandom(4).hex())
        handle = os.open(path, NEW_FILE, 0o666)
        hold(handle)
        if is_at(path, handle):  # not taken away by another run between the two calls
            return handle, path
        os.close(handle)


def write_file(path: Path, content: Content) -> str:
    """Write a new file where nobody else looks, and flush it to the disk; its `checksum`."""
    handle = os.open(path, NEW_FILE, 0o666)
    try:
        return _write(handle, content)
    finally:
        os.close(handle)


def _write(handle: int, content: Content) -> str:
    crc = size = 0
    for block in _blocks(encoded(content)):
        crc, size = zlib.crc32(block, crc), size + len(block)
        rest = memoryview(block)
        while rest:
            rest = rest[os.write(handle, rest) :]
    os.fsync(handle)
    return f"{crc:08x}-{size}"


def checksum(path: Path) -> str:
    """CRC-32 and length of a file's content, by which an edit is seen. Raises `OSError`.

    A file that grew or shrank has another length, and CRC-32 misses one in 4e9 of the other changes (none within 32
    bits; Peterson and Brown, "Cyclic codes for error detection", Proc. IRE 49 (1961) 228). Against somebody who forges
    a file nothing is to be kept here, and SHA-256 of a table of a million lines takes as long as its pictures.
    """
    crc = size = 0
    with path.open("rb", buffering=0) as stream:
        while block := stream.read(BLOCK):
            crc, size = zlib.crc32(block, crc), size + len(block)
    return f"{crc:08x}-{size}"


def _blocks(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The pieces, small ones together."""
    held = bytearray()
    for piece in pieces:
        if len(piece) >= BLOCK and not held:
            yield piece
            continue
        held += piece
        if len(held) >= BLOCK:
            yield bytes(held)
            held.clear()
    if held:
        yield bytes(held)


def sync_folder(folder: Path) -> None:
    """Flush the names in a folder to the disk, where the system can."""
    with suppress(OSError):  # a folder that may not be read, a file system that knows no such thing
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def exchange(new: Path, old: Path) -> bool:
    """Exchange two folders of one file system in one step; False where that cannot be done."""
    if sys.platform != "linux":
        return False
    import ctypes

    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    if rename(AT_FDCWD, os.fsencode(new), AT_FDCWD, os.fsencode(old), RENAME_EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in NOT_EXCHANGED:
        return False
    raise OSError(code, os.strerror(code), str(old))


def encoded(content: Content) -> Iterator[bytes]:
    """The content as bytes, piece by piece: text as UTF-8."""
    if isinstance(content, bytes):
        yield content
    else:
        for piece in [content] if isinstance(content, str) else content:
            yield piece.encode("utf-8", "replace") if isinstance(piece, str) else piece


def is_file(path: str | Path) -> bool:
    """Whether there is such a file; False as well for a name that none can have (too long, a circle of links)."""
    try:
        return Path(path).is_file()
    except OSError:
        return False


def read_bytes(path: str | Path, what: str, most: int = LARGEST_BYTES) -> bytes:
    """Content of a file; `what` names it in messages, `most` are the bytes that it may have. Raises `InputError`."""
    try:
        check_regular(Path(path), pipes=True)
        with Path(path).open("rb") as stream:
            content = _read(stream, most)
    except (OSError, ValueError) as error:  # ValueError: a zero byte in the name
        cause = reason(error) if isinstance(error, OSError) else str(error)
        raise FileError(f"cannot read {what} {str(path)!r}: {cause}") from None
    if len(content) > most:
        raise FileError(f"{what} {str(path)!r} has more than {most / 1e6:.0f} MB", hint="is it the right file?")
    return content


def check_regular(path: Path, pipes: bool = False) -> None:
    """Refuse what reading may never come to the end of: a device, or a named pipe that waits for its writer.

    With `pipes`, those of the shell (`/dev/stdin`, `<(command)`) pass, as their writer is there. A folder passes: the
    system's own error says that it is one. Raises `OSError`.
    """
    mode = path.stat().st_mode
    shell = pipes and stat.S_ISFIFO(mode) and path.is_absolute() and path.parts[1] in ("dev", "proc")
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode) or shell):
        raise OSError(errno.EINVAL, "it is not a regular file")


def _read(stream: BinaryIO, most: int) -> bytes:
    """All of it, or a little more than it may have, of a pipe."""
    state = os.fstat(stream.fileno())
    if stat.S_ISREG(state.st_mode) and state.st_size <= most:
        return stream.read()
    pieces, length = [], 0
    while length <= most and (piece := stream.read(BLOCK)):
        pieces.append(piece)
        length += len(piece)
    return b"".join(pieces)


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
    given = [Path(file) for file in inputs if is_file(file)]
    read = [Path(out) for out in outputs if is_file(out) and any(Path(out).samefile(file) for file in given)]
    if read and not replace:
        raise FileError(
            f"{str(read[0])!r} is read here and would be written over",
            hint="write somewhere else, or say --replace (replace=True): the old file is kept beside the new one",
        )
    return read


def keep_old(file: str | Path) -> Path | None:
    """Copy a file to a free name beside it, `NAME.old` or `NAME.old2` and so on; None where there is no file.

    Raises `InputError` where that cannot be done.
    """
    path = Path(file)
    if not path.is_file():
        return None
    kept = path.with_name(free_name(path.name, lambda name: os.path.lexists(path.with_name(name))))
    return write_atomically(kept, read_bytes(path, "file"))


def free_name(name: str, taken: Callable[[str], bool]) -> str:
    """`NAME.old`, or `NAME.old2` and so on, whichever is not taken first."""
    numbers = itertools.chain([""], itertools.count(2))
    return next(free for number in numbers if not taken(free := f"{name}.old{number}"))
