"""Program text: bytes to lines, whatever the editor, the control or the mailer did to them."""

from __future__ import annotations

from pathlib import Path

from toolpath_stiff.errors import InputError

# Control characters that a text file may hold: tab, line feed, form feed, carriage return, and the old
# end-of-file mark of CP/M and DOS, which some posts still append.
ALLOWED_CONTROLS = {0x09, 0x0A, 0x0C, 0x0D, 0x1A}


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
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if not text.isprintable():
        for number, line in enumerate(lines, 1):
            for column, character in enumerate(line, 1):
                code = ord(character)
                if (code < 0x20 and code not in ALLOWED_CONTROLS) or code == 0x7F:
                    raise InputError(
                        f"binary byte 0x{code:02X}",
                        expected="the text of an NC program",
                        file=name,
                        line=number,
                        column=column,
                    )
    if lines and not lines[-1]:
        lines.pop()
    return tuple(line.replace("\x1a", "").replace("\x0c", " ") for line in lines)
