"""Physical effects along the load path, one flat file each; what a file of your own imports."""

from toolpath_stiff.stiffness.contract import LINKS, Conditions, Effect, LoadPath, Parameter

__all__ = ["LINKS", "Conditions", "Effect", "LoadPath", "Parameter"]
