"""Files of a case: copies under free names, and copies with readings commented out."""

import re
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Measurements
from toolpath_stiff.column_files import csv_text
from toolpath_stiff.errors import TpsError
from toolpath_stiff.files import read_bytes, write_atomically
from toolpath_stiff.readings.measurements import NIST_TABLE_1

UNSAFE = re.compile(r"[^\w.+-]+", re.ASCII)
LONGEST_NAME = 80


def free_name(folder: Path, name: str) -> str:
    """The name, or the first of its numbered variants that the folder does not have yet."""
    path, number = Path(name), 1
    stem = re.sub(r"-[0-9]+$", "", path.stem)
    while (folder / name).exists():
        number += 1
        name = str(path.with_name(f"{stem}-{number}{path.suffix}"))
    return name


@contextmanager
def kept_if_read(folder: Path, names: Sequence[str]) -> Iterator[None]:
    """Remove the new files of the case again if they cannot be read."""
    try:
        yield
    except TpsError:
        for name in names:
            (folder / name).unlink()
        raise


def copied(folder: Path, file: str | Path, room: str, content: bytes | None = None) -> str:
    """Copy a file, or `content` under its name, into a subfolder of the case under a free name, which is returned."""
    content = read_bytes(file, "the file") if content is None else content
    source = Path(str(file).partition("#")[0])
    suffix = ".csv" if room == "data" else UNSAFE.sub("_", source.suffix)
    name = free_name(folder, f"{room}/{UNSAFE.sub('_', source.stem)[:LONGEST_NAME].lstrip('.') or 'file'}{suffix}")
    write_atomically(folder / name, content)
    return name


def measurements_csv(file: str | Path, machine: Machine) -> bytes:
    """A measurement file as CSV: a CSV file unchanged, a workbook or packaged data as a table."""
    name = str(file)
    if name != NIST_TABLE_1 and ".xlsx" not in name.lower():
        return read_bytes(name, "measurements")
    frame = Measurements([name]).to_frame(machine).drop(columns=["file", "line"])
    return csv_text(list(frame.columns), frame.astype(str).replace("nan", "").to_numpy().tolist()).encode()


def without_lines(file: Path, lines: Collection[int]) -> bytes:
    """A file with these lines commented out, so that the others keep their numbers."""
    rows = file.read_bytes().split(b"\n")
    return b"\n".join(b"# " + row if number in lines else row for number, row in enumerate(rows, 1))
