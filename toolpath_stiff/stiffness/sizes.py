"""Sizes and lists in the form that sentences use."""

from collections.abc import Sequence


def joined(parts: Sequence[str]) -> str:
    """Parts listed as in a sentence, "a, b and c"; "nothing" without parts."""
    if len(parts) < 2:
        return parts[0] if parts else "nothing"
    return f"{', '.join(parts[:-1])} and {parts[-1]}"


def sizes_in_words(sizes: Sequence[tuple[float, str]]) -> str:
    """Nonzero sizes, each with its unit and place: "0.35 nm/N along X and 0.19 nm/N along Y"."""
    return joined([f"{about(size)} {words}" for size, words in sizes if size])


def about(size: float) -> str:
    """Magnitude to two digits, without sign: "19", "0.054"."""
    return f"{float(f'{abs(size):.2g}'):g}"
