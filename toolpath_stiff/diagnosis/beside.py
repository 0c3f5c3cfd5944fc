"""What is neither shown nor excluded beside a verdict, in words, and where an indicator would tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from toolpath_stiff.inference.candidates import choice_text
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.planning.plan import INDICATORS
from toolpath_stiff.stiffness.sizes import joined

MOST_BESIDE = 3  # effects in a sentence on what is not excluded; a document has all


def beside_text(unexcluded: Sequence[Unexcluded]) -> str:
    """What is neither shown nor excluded, and where an indicator would tell; "" where there is nothing."""
    if not unexcluded:
        return ""
    named, more = unexcluded[:MOST_BESIDE], len(unexcluded) - MOST_BESIDE
    effects = [
        f"{hidden.effect.name} ({_up_to(hidden)}, {100.0 * hidden.rms:.2g} % of the tip's stiffness)"
        for hidden in named
    ]
    effects += [f"{more} more"] if more > 0 else []
    places = dict.fromkeys(INDICATORS[hidden.effect.link].split(":")[0] for hidden in named)
    tells = " or ".join(place for place in places if place != "none")
    words = f"{joined(effects)}: the readings neither show nor exclude {'it' if len(unexcluded) == 1 else 'them'}"
    return f"{words}; an indicator {tells} would tell" if tells else words


def _up_to(hidden: Unexcluded) -> str:
    """The size up to which an effect is not excluded, with its unit and what it acts on; a stiffness goes down."""
    parameter = hidden.parameter
    chosen = [choice_text(key, value) for key, value in hidden.candidate.choice if value not in ("", 0)]
    way = "down to" if np.isinf(parameter.neutral) else "up to"
    return ", ".join([f"{way} {float(f'{hidden.value / parameter.si:.2g}'):g} {parameter.unit}", *chosen])


def would_tell(hidden: Unexcluded) -> str:
    """Where an indicator would show an effect, or what else to measure."""
    place = INDICATORS[hidden.effect.link]
    return place.removeprefix("none: ") if place.startswith("none: ") else f"an indicator {place}"
