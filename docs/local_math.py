"""Formulas as MathML, which browsers draw themselves: the site needs no script or font from elsewhere."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

# docutils takes the 12 of \tfrac12 for one number, and does not know \mathrel.
REPLACED = (
    (re.compile(r"\\([td]?frac)\s*(\d)\s*(\d)"), r"\\\1{\2}{\3}"),
    (re.compile(r"\\mathrel\s*\{(.)\}"), r"\1"),
)


def as_mathml(tex: str, *, block: bool) -> str:
    """A formula in TeX as a MathML element."""
    for pattern, replacement in REPLACED:
        tex = pattern.sub(replacement, tex)
    return str(tex2mathml(tex, as_block=block))


def visit_inline(translator: Any, node: nodes.math) -> None:
    """Write a formula within a line."""
    translator.body.append(as_mathml(node.astext(), block=False))
    raise nodes.SkipNode


def visit_block(translator: Any, node: nodes.math_block) -> None:
    """Write a formula of its own line."""
    translator.body.append(f'<div class="formula">{as_mathml(node.astext(), block=True)}</div>')
    raise nodes.SkipNode


def setup(app: Any) -> dict[str, bool]:
    """Register with Sphinx."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
