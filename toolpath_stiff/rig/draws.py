"""Draws of everything about a hidden effect but its size: its strut, axis, place."""

from collections.abc import Callable
from typing import Any

Shape = dict[str, Any]  # by name
Draw = Callable[..., Shape]  # of a generator, how many vertices the frame has, which set-ups there are


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
