"""The process that those for long work are forked from: it loads the libraries once, beside the studio's own start."""

import multiprocessing
from multiprocessing import forkserver
from multiprocessing.context import BaseContext

MODULES = ("studio.work", "correction.update", "diagnosis.diagnose", "analysis.results", "planning.result")


def prepared() -> BaseContext:
    """Processes that begin with the libraries loaded, from now on, where the system can do that; else from scratch."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pandas", *(f"toolpath_stiff.{name}" for name in MODULES)])
    forkserver.ensure_running()
    return context
