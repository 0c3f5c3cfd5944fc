"""The picture of a machine that was checked."""

from toolpath_stiff.report.pictures.machine import machine_checked

PICTURES = {"machine.png": machine_checked}
