"""Unknowns: physics of links that no effect of the catalogue describes.

Each kind acts on the rig's own elements. What a description of it may name is settled from its physics, before any
diagnosis sees it: `links`, the links of the load path whose give has this signature at the tool tip, and `variables`,
what it varies with first of all. Several are right where they cannot differ in principle: a spring between tool and
work in base axes may sit in the frame as well as under the table; the temperature of a campaign that follows its clock
is a function of the order of the readings.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig.draws import Hideable, Shape

Physics = TypeVar("Physics", bound=Callable[..., Any])
X, Y, Z = np.eye(3)

SOFT = 60e-9  # m/N, largest compliance that is tried: far beyond 30 % of a tip that gives 8 to 31 nm/N
REACH = 0.3  # m, half the width of the workspace that the paper measured
SIGN_WIDTH = 30.0  # N over which a seat opens: no contact lets go at a stroke (assumed)


@dataclass(frozen=True)
class Unknown:
    """One unknown in one machine.

    Attributes
    ----------
    kind
        Its name in `UNKNOWNS`.
    size
        In the kind's own SI unit, or a ratio.
    shape
        What else was drawn: which strut, which axis, where.
    """

    kind: str
    size: float
    shape: Shape = field(default_factory=dict)


def kind(
    kinds: dict[str, Hideable], role: str, links: str, variables: str, limit: float, **more: Any
) -> Callable[[Physics], Physics]:
    """Register the decorated function as a kind under its name; links, variables and needed columns with commas.

    `role`: `act` or `read`.
    """
    more.update(links=frozenset(links.split(",")), variables=frozenset(variables.split(",")))
    columns = tuple(filter(None, more.pop("needs", "").split(",")))

    def registered(physics: Physics) -> Physics:
        more.update({role: physics, "change": lambda _, p: {"unknown": Unknown(physics.__name__, p["size"], dict(p))}})
        kinds[physics.__name__] = Hideable(limit=limit, columns=columns, **more)
        return physics

    return registered


def opened(pull: FloatArray) -> FloatArray:
    """0 where a seat is pressed, 1 where it is pulled by `pull` N, with a smooth change over some newtons."""
    return np.asarray(0.5 * (1.0 + np.tanh(pull / SIGN_WIDTH)))


def beyond(force: FloatArray, threshold: float) -> FloatArray:
    """Secant compliance, relative to the open state, of a link that is rigid up to a force f0: (|f| - f0) / |f|."""
    return np.asarray(np.maximum(0.0, 1.0 - threshold / np.maximum(np.abs(force), 1e-9)))
