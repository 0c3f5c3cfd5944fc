"""Templates, style sheets and scripts of the pages: one style sheet for all, filled in one pass, one script a page."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Mapping
from importlib import resources


def asset(name: str) -> str:
    """Text of a file in `assets/`."""
    return resources.files("toolpath_stiff.report").joinpath("assets", name).read_text(encoding="utf-8")


def style(*names: str) -> str:
    """The style sheet of all pages, and further ones after it."""
    return "".join(map(asset, ("page.css", *names)))


def filled(template: str, parts: Mapping[str, str]) -> str:
    """The template with its {{names}} replaced in one pass, so that nothing inserted is looked at again."""
    return re.sub(r"\{\{(\w+)\}\}", lambda match: parts[match[1]], template)


def script_hash(script: str) -> str:
    """The source expression of Content Security Policy Level 3, section 2.3.1."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode("utf-8")).digest()).decode("ascii")
