"""Run as a program: limits itself, then becomes another one. `limiter.py CPU_S MEMORY_B FILE_B COMMAND ...`.

The limits of the kernel bind on whatever the command starts, and it starts nothing: no process and no thread. A user's
number of processes is limited to none, which does not bind root; so a filter refuses the system calls that make them.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import struct
import sys

PR_SET_PDEATHSIG, PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 1, 38, 22, 2
# linux/audit.h, and the numbers of clone, fork, vfork, clone3 on each machine (asm/unistd.h).
ARCHITECTURES = {"x86_64": (0xC000003E, (56, 57, 58, 435)), "aarch64": (0xC00000B7, (220, 435))}
# linux/filter.h and linux/seccomp.h
LOAD, JUMP_EQUAL, JUMP_ABOVE, RETURN = 0x20, 0x15, 0x25, 0x06
CALL_NUMBER, ARCHITECTURE = 0, 4  # offsets in seccomp_data
HIGHEST_CALL = 0x3FFFFFFF  # beyond are those of x32
ALLOW, REFUSE = 0x7FFF0000, 0x00050001  # EPERM


def filter_program(architecture: int, calls: tuple[int, ...]) -> bytes:
    """The instructions (struct sock_filter) that refuse some system calls, and all of another architecture."""
    refuse = len(calls) + 1  # instructions from the first comparison of a call to the refusal
    lines = [
        (LOAD, 0, 0, ARCHITECTURE),
        (JUMP_EQUAL, 0, refuse + 2, architecture),
        (LOAD, 0, 0, CALL_NUMBER),
        (JUMP_ABOVE, refuse, 0, HIGHEST_CALL),
    ]
    for place, call in enumerate(calls):
        lines.append((JUMP_EQUAL, refuse - place - 1, 0, call))
    lines += [(RETURN, 0, 0, ALLOW), (RETURN, 0, 0, REFUSE)]
    return b"".join(struct.pack("HBBI", *line) for line in lines)


def start_nothing() -> bool:
    """Refuse new processes from here on; False where this machine has no such filter."""
    if os.uname().machine not in ARCHITECTURES:
        return False
    code = filter_program(*ARCHITECTURES[os.uname().machine])
    buffer = ctypes.create_string_buffer(code, len(code))
    program = ctypes.create_string_buffer(struct.pack("HxxxxxxQ", len(code) // 8, ctypes.addressof(buffer)))
    try:
        library = ctypes.CDLL(None, use_errno=True)
        if library.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0):
            return False
        return not library.prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, program, 0, 0)
    except OSError:
        return False


def end_with_the_caller() -> None:
    """SIGKILL when the process that started this one is gone, however it ended."""
    try:
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    except (OSError, AttributeError):  # not Linux
        return


def main() -> None:
    """Set the limits and become the command."""
    end_with_the_caller()
    cpu, memory, size = map(int, sys.argv[1:4])
    resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu + 1))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_NPROC, (0, 0))
    start_nothing()
    os.execv(sys.argv[4], sys.argv[4:])


if __name__ == "__main__":
    main()
