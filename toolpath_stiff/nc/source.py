"""Program text: bytes to lines, whatever the editor, the control or the mailer did to them."""

from __future__ import annotations

import re
from pathlib import Path

from toolpath_stiff.errors import InputError

# Control characters that no text file holds. It may hold tab, line feed, form feed, carriage return, and the old
# end-of-file mark of CP/M and DOS (0x1A), which some posts still append.
BINARY = re.compile("[\x00-\x08\x0b\x0e-\x19\x1b-\x1f\x7f]")


def read_lines(path: str | Path) -> tuple[str, ...]:
    """Lines of a program file, without line ends. UTF-8 (with or without BOM) or Latin-1; LF, CRLF or CR.

    Raises
    ------
    InputError
        The file cannot be read or is not text.
    """
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"cannot read {str(path)!r}: {error.strerror}") from None
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = content.decode("latin-1")
    return split_lines(text, Path(path).name)


def split_lines(text: str, name: str) -> tuple[str, ...]:
    """Split into lines; a byte that no text holds is an error with its line and column."""
    joined = text.replace("\r\n", "\n").replace("\r", "\n")
    binary = BINARY.search(joined)
    if binary is not None:
        at = binary.start()
        raise InputError(
            f"binary byte 0x{ord(binary[0]):02X}",
            expected="the text of an NC program",
            file=name,
            line=joined.count("\n", 0, at) + 1,
            column=at - joined.rfind("\n", 0, at),
        )
    found = joined.replace("\x1a", "").replace("\x0c", " ").split("\n")
    if not found[-1]:
        found.pop()
    return tuple(found)
