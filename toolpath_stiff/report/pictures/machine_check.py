"""The picture of a machine that was checked."""

from toolpath_stiff.report.pictures.machine import machine_views

PICTURES = {"machine.png": machine_views}
