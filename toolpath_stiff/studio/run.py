"""Opening a case for the studio, and serving it until it is ended."""

from __future__ import annotations

import os
import shutil
import signal
import threading
import webbrowser
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from toolpath_stiff.defaults import MACHINE
from toolpath_stiff.errors import InputError, TpsError
from toolpath_stiff.files import is_file, writing_errors
from toolpath_stiff.studio.preloading import prepared

if TYPE_CHECKING:
    from toolpath_stiff.case.case import Case


def opened_case(folder: str, trust: Sequence[str], machine: str | None, exercise: int | None) -> Case:
    """Case in a folder, existing or new. Raises `InputError` if an existing one is given machine or exercise."""
    prepared()  # beside what is loaded here
    from toolpath_stiff.case.case import Case
    from toolpath_stiff.case.state import CASE_FILE

    there = is_file(Path(folder) / CASE_FILE)
    if there and (machine is not None or exercise is not None):
        name = "machine" if machine is not None else "exercise"
        raise InputError(f"--{name}: the case {folder} is there already", hint="name another folder with --case")
    case = Case.open(folder, machine or MACHINE, trust)
    if exercise is not None:
        case.start_exercise(exercise)
    return case


@contextmanager
def removed_if_refused(folder: str) -> Iterator[None]:
    """Remove a case's folder, if it is new, when a file that the case is to hold cannot be used."""
    with writing_errors(folder, "open the case"):  # a name that is too long, a circle of links
        new = not Path(folder).exists()
    try:
        yield
    except TpsError:
        if new:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def serve(case: Case, port: int = 0, *, browser: bool = True) -> int:
    """Serve until Ctrl-C or a request to end; returns 0. Raises `InputError` if the port is taken."""
    from toolpath_stiff.studio.server import Studio
    from toolpath_stiff.studio.session import Session

    os.chdir(case.folder)  # so that files are named as the commands in the history name them
    case.folder = Path()
    session = Session(case)
    try:
        studio = Studio(session, port)
    except OSError as error:
        session.close()
        raise InputError(f"port {port}: {error.strerror}", hint="leave --port out to use a free one") from None
    print(f"case    {Path.cwd()}\nstudio  {studio.address}\nCtrl-C ends it", flush=True)
    signal.signal(signal.SIGTERM, lambda *_: threading.Thread(target=studio.close).start())
    if browser:
        threading.Thread(target=webbrowser.open, args=(studio.address,), daemon=True).start()
    try:
        studio.serve_forever(poll_interval=0.2)
    except KeyboardInterrupt:
        session.close()
        studio.server_close()
    return 0
