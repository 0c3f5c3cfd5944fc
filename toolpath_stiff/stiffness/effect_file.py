"""The text of a file with an effect."""

from typing import Any, ClassVar

from toolpath_stiff.results import TextFile


class EffectFile(TextFile):
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

    def to_dict(self) -> dict[str, Any]:
        """Name and text."""
        return {"effect": self.name, "text": self.text}
