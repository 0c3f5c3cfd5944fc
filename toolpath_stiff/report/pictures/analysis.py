"""Pictures of an analysis."""

from toolpath_stiff.report.pictures.part import part
from toolpath_stiff.report.pictures.path import path
from toolpath_stiff.report.pictures.profile import profile

PICTURES = {"path.png": path, "profile.png": profile, "cut.png": part}
