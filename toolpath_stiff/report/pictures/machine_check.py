"""Picture of a checked machine."""

from toolpath_stiff.report.pictures.machine import machine_checked

PICTURES = {"machine.png": machine_checked}
