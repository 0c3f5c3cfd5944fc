"""Whole processes and what they cost; the machine that they ran on."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path


def whole_process(command: list[str], folder: str = ".", allowed: tuple[int, ...] = (0,)) -> tuple[float, float]:
    """CPU seconds (user and system) and peak memory (MB) of a process."""
    child = subprocess.Popen(command, cwd=folder, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    if child.returncode not in allowed:
        raise SystemExit(f"{' '.join(command)} ended with {child.returncode}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024.0


def whole_command(arguments: list[str], folder: str = ".", allowed: tuple[int, ...] = (0,)) -> tuple[float, float]:
    """The same of a `tps` command."""
    return whole_process([sys.executable, "-m", "toolpath_stiff", *arguments], folder, allowed)


def describe_machine() -> str:
    """Processor and versions."""
    from importlib.metadata import version

    model = platform.processor() or platform.machine()
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        names = [
            line.split(":", 1)[1].strip() for line in cpuinfo.read_text().splitlines() if line.startswith("model name")
        ]
        model = names[0] if names else model
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "openseespy"))
    return f"{model}; Python {platform.python_version()}; {packages}; one core"
