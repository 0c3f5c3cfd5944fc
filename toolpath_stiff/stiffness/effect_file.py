"""The text of a file with an effect."""

from __future__ import annotations

from pathlib import Path
from typing import Any, ClassVar

from toolpath_stiff.files import write_atomically
from toolpath_stiff.results import Result


class EffectFile(Result):
    """The text of a file with an effect.

    Attributes
    ----------
    name, text
        The effect's name; the file.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import toolpath_stiff as tps
    >>> template = tps.effect_template("my_screw")
    >>> template.to_dict()["effect"], template.text == str(template)
    ('my_screw', True)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = template.save(pathlib.Path(folder, "my_screw.py"))
    ...     tps.effects([file])["my_screw"].link
    'struts'
    """

    command: ClassVar[str] = "effects"

    def __init__(self, name: str, text: str) -> None:
        self.name, self.text = name, text

    def to_dict(self) -> dict[str, Any]:
        """Name and text."""
        return {"effect": self.name, "text": self.text}

    def __str__(self) -> str:
        return self.text

    def _short(self) -> str:
        return f"{self.name}, {len(self.text.splitlines())} lines"

    def save(self, file: str | Path) -> Path:
        """Write the file, whole or not at all."""
        return write_atomically(file, self.text)
