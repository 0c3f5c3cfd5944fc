"""Physical effects along the load path, one flat file each; `contract` says what an effect is."""

from toolpath_stiff.stiffness.effects.contract import DEFAULT_FORCE, LINKS, Conditions, Effect, LoadPath, Parameter
from toolpath_stiff.stiffness.effects.registry import effects_from_file, find_effect, known_effects

__all__ = [
    "DEFAULT_FORCE",
    "LINKS",
    "Conditions",
    "Effect",
    "LoadPath",
    "Parameter",
    "effects_from_file",
    "find_effect",
    "known_effects",
]
