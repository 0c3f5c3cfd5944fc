"""Whole processes and what they cost; the machine that they ran on."""

import os
import platform
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

# A small process starts what is measured: the largest memory of a process counts what it was forked from.
LAUNCHER = """
import os, subprocess, sys
child = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL)
_, status, usage = os.wait4(child.pid, 0)
print(os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime, usage.ru_maxrss)
"""


def whole_process(command: list[str], folder: str = ".", allowed: tuple[int, ...] = (0,)) -> tuple[float, float]:
    """CPU seconds (user and system) and peak memory (MB) of a process; modules stay compiled, as pip leaves them."""
    launch = [sys.executable, "-I", "-S", "-c", LAUNCHER, *command]
    compiled = os.environ | {"PYTHONDONTWRITEBYTECODE": ""}
    told = subprocess.check_output(launch, cwd=folder, text=True, env=compiled).split()
    if int(told[0]) not in allowed:
        raise SystemExit(f"{' '.join(command)} ended with {told[0]}")
    return float(told[1]), float(told[2]) / 1024.0


def whole_command(arguments: list[str], folder: str = ".", allowed: tuple[int, ...] = (0,)) -> tuple[float, float]:
    """The same of a `tps` command."""
    return whole_process([sys.executable, "-m", "toolpath_stiff", *arguments], folder, allowed)


def describe_machine() -> str:
    """Processor and versions."""
    cpuinfo = Path("/proc/cpuinfo")
    found = re.search(r"^model name\s*:\s*(.*)", cpuinfo.read_text() if cpuinfo.exists() else "", re.MULTILINE)
    model = found[1].strip() if found else platform.processor() or platform.machine()
    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "numba", "openseespy"))
    return f"{model}; Python {platform.python_version()}; {packages}; one core; all seconds are of CPU, user and system"
