"""LinuxCNC's own interpreter (`rs274`) as a second reader of NC programs: fence, copy, run, moves."""
