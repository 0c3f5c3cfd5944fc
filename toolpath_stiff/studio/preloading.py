"""A process with the libraries preloaded, beside the studio's own start, from which workers are forked."""

import multiprocessing
from multiprocessing import forkserver
from multiprocessing.context import BaseContext

MODULES = ("studio.work", "correction.update", "diagnosis.diagnose", "analysis.results", "planning.result")


def prepared() -> BaseContext:
    """Context for new processes: forked with the libraries loaded if the system allows it, otherwise from scratch."""
    if "forkserver" not in multiprocessing.get_all_start_methods():
        return multiprocessing.get_context("spawn")
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["pandas", *(f"toolpath_stiff.{name}" for name in MODULES)])
    forkserver.ensure_running()
    return context
