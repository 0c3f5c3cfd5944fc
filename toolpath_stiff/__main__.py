"""`python -m toolpath_stiff` is `tps`."""

from toolpath_stiff.cli.main import entry

entry()
