"""Physical effects along the load path, one flat file each; also the names that a user's effect file imports."""

from toolpath_stiff.stiffness.contract import LINKS, Conditions, Effect, LoadPath, Parameter

__all__ = ["LINKS", "Conditions", "Effect", "LoadPath", "Parameter"]
