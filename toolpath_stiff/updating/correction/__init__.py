"""The missing effect added: fitted, judged, written to a machine file with its origin."""

from toolpath_stiff.updating.correction.ladder import Update, update

__all__ = ["Update", "update"]
