"""Whatever the rig can hide, with the draws of everything about it but its size: its strut, axis, place."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

Shape = dict[str, Any]  # by name
Draw = Callable[..., Shape]  # of a generator, how many vertices the frame has, which set-ups there are
Change = Callable[[Any, Shape], Shape]  # of a machine and parameters in shop units: fields, by name


def uniform(name: str, low: float, high: float) -> Draw:
    """Draw of one number from a range."""
    return lambda rng, *_: {name: float(rng.uniform(low, high))}


def whole(name: str, low: int, beyond_high: int) -> Draw:
    """Draw of one whole number from `low` to below `beyond_high`."""
    return lambda rng, *_: {name: int(rng.integers(low, beyond_high))}


def either(name: str) -> Draw:
    """Draw of 1 or -1."""
    return lambda rng, *_: {name: float(rng.choice([-1.0, 1.0]))}


def drawn(*draws: Draw) -> Draw:
    """Several draws, one after the other."""
    return lambda rng, *there: {name: value for draw in draws for name, value in draw(rng, *there).items()}


nothing = drawn()
one_strut, side, signed = whole("strut", 0, 6), either("side"), either("sign")  # a strut from 0


@dataclass(frozen=True)
class Hideable:
    """Something to hide: an effect of the catalogue, an unknown, or a fault of finite elements.

    Attributes
    ----------
    change
        What its parameters change of a machine.
    limit
        Largest size that is tried.
    shape
        What is drawn beside the size: which strut, which axis, which proportions; `sign` goes to the size.
    columns
        Columns that a measurement file needs to show it.
    sized
        Parameters proportional to the size, and to their share in the shape.
    written
        Value of a parameter from that product.
    links, names, variables
        What a description may name: links of the load path whose give has this signature at the tip, effects of the
        catalogue, what it varies with; None: none is asked for.
    act, read
        Of an unknown: what it does to the links, or (n,) the factor on the stiffness that is read.
    """

    change: Change
    limit: float
    shape: Draw = nothing
    columns: tuple[str, ...] = ()
    sized: tuple[str, ...] = ("size",)
    written: Callable[[float], float] = float
    links: frozenset[str] | None = None
    names: frozenset[str] | None = None
    variables: frozenset[str] | None = None
    act: Callable[..., Any] | None = None
    read: Callable[..., Any] | None = None

    def grown(self, strength: float, shape: Shape) -> Shape:
        """Parameters in shop units of a shape at a strength in (0, 1]."""
        shares = {**dict.fromkeys(self.sized, shape.get("sign", 1.0)), **shape}
        sizes = {name: self.written(self.limit * strength * float(shares[name])) for name in self.sized}
        return {key: value for key, value in shape.items() if key != "sign"} | sizes
