"""Files of a case: copies under names that are free, readings that are commented out, sums that tell a change."""

import hashlib
import re
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Measurements
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.errors import InputError
from toolpath_stiff.files import read_bytes, write_atomically
from toolpath_stiff.readings.measurements import NIST_TABLE_1

UNSAFE = re.compile(r"[^\w.+-]+", re.ASCII)
LONGEST_NAME = 80


def free_name(folder: Path, name: str) -> str:
    """The name, or the next one with a number that the folder does not have yet."""
    path, number = Path(name), 1
    while (folder / name).exists():
        number += 1
        name = str(path.with_name(f"{path.stem}-{number}{path.suffix}"))
    return name


def drop(folder: Path, *names: str) -> None:
    """Take files away again that turned out to be of no use."""
    for name in names:
        (folder / name).unlink()


def first_name(name: str) -> str:
    """A file's name without the room and the number that a case gave it: "effects/drag-2.py" came as drag.py."""
    path = Path(name)
    return re.sub(r"-\d+$", "", path.stem) + path.suffix


def write_files(folder: Path, contents: Mapping[str, str | bytes]) -> None:
    """Write files of a folder, each whole or not at all."""
    for name, content in contents.items():
        write_atomically(folder / name, content)


def copied(folder: Path, file: str | Path, room: str, content: bytes | None = None) -> str:
    """Copy a file, or this content under its name, into a room of the case under a name that is free; the name."""
    content = read_bytes(file, "the file") if content is None else content
    source = Path(str(file).partition("#")[0])
    suffix = ".csv" if room == "data" else UNSAFE.sub("_", source.suffix)
    name = free_name(folder, f"{room}/{UNSAFE.sub('_', source.stem)[:LONGEST_NAME].lstrip('.') or 'file'}{suffix}")
    write_files(folder, {name: content})
    return name


def measurements_csv(file: str | Path, machine: Machine) -> bytes:
    """A measurement file as CSV: a CSV file as it stands, a workbook or packaged data as a table."""
    name = str(file)
    if name != NIST_TABLE_1 and ".xlsx" not in name.lower():
        return read_bytes(name, "measurements")
    frame = Measurements([name]).to_frame(machine).drop(columns=["file", "line"])
    return csv_text(list(frame.columns), frame.astype(str).replace("nan", "").to_numpy().tolist()).encode()


def machine_bytes(machine: str | Path) -> bytes:
    """The content of a machine file, packaged or one's own."""
    if str(machine) in Machine.names():
        return (resources.files("toolpath_stiff") / "data" / "machines" / f"{machine}.toml").read_bytes()
    return read_bytes(machine, "machine file")


def used_name(name: str) -> str:
    """Where a measurement file stands without the readings that were set aside."""
    return f"used/{Path(name).name}"


def without_lines(file: Path, lines: Sequence[int]) -> bytes:
    """A file with these lines commented out."""
    rows = file.read_bytes().split(b"\n")
    for line in lines:
        if not 1 <= line <= len(rows):
            raise InputError(f"{file.name} has no line {line}")
        rows[line - 1] = b"# " + rows[line - 1]
    return b"\n".join(rows)


def sha256(content: bytes) -> str:
    """The sum under which a case knows a file again."""
    return hashlib.sha256(content).hexdigest()
