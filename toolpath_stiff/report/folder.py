"""Single entry to views and pictures: the view of a result is found by its name, `shown_by`.

A view is a module of this room: `text(result)`, and of a result that is a folder `DATA`, file name -> what makes it of
the result; `PAGE`, the name of its page, `page(result, drawn, **look)`, which makes it, and `QUESTIONS`,
the pictures that stand in it. The pictures are in the module of that name in `pictures`, which imports matplotlib.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Collection, Mapping
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

from toolpath_stiff.files import Content

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def view_of(shown_by: str) -> ModuleType:
    """View module of this name."""
    return import_module(f"toolpath_stiff.report.{shown_by}")


def pictures_of(shown_by: str) -> Mapping[str, Callable[..., Figure | None]]:
    """File name -> function that draws the picture of a result; it returns None if there is nothing to show."""
    module = f"toolpath_stiff.report.pictures.{shown_by}"
    pictures: Mapping[str, Callable[..., Figure | None]] = import_module(module).PICTURES if find_spec(module) else {}
    return pictures


def quicken_pictures() -> None:
    """Make pictures quickly in a process of ours alone. To be called before the first one.

    Lists of properties stay out of matplotlib's docstrings and signatures, where nobody reads them: they are made while
    it is imported, and take two thirds of that. Its figures are many small objects, among which the collector would
    search for rubbish all the time, for a sixth of what programs with pictures take.
    """
    gc.set_threshold(20_000, 10, 50)
    artist: Any = import_module("matplotlib.artist")
    artist.Artist._update_set_signature_and_docstring = lambda *_: None  # where it is gone, nothing happens
    artist.kwdoc = lambda _: ""


def _writer() -> ModuleType:
    return import_module("toolpath_stiff.report.pictures.files")


def names(shown_by: str, plots: bool = True, omit: Collection[str] = ()) -> tuple[str, ...]:
    """Names of the files that `files` may make."""
    view = view_of(shown_by)
    data = tuple(name for name in view.DATA if name not in omit)
    if not plots:
        return data
    pictures = (name for name in pictures_of(shown_by) if name not in omit)
    return (*data, *pictures, *filter(None, [getattr(view, "PAGE", "")]))


def files(
    result: Any, *, plots: bool = True, omit: Collection[str] = (), **look: Any
) -> dict[str, Content | Callable[[], Content]]:
    """Name -> content, or its maker, of a result's files except `omit`; `plots`: also pictures and page."""
    view = view_of(result.shown_by)
    contents: dict[str, Content | Callable[[], Content]] = {
        name: partial(make, result) for name, make in view.DATA.items() if name not in omit
    }
    if not plots:
        return contents
    writer, questions = _writer(), getattr(view, "QUESTIONS", {})
    drawn: dict[str, bytes] = {}
    for name, draw in pictures_of(result.shown_by).items():
        if name in questions and name not in omit:
            drawn |= {name: content} if (content := writer.picture_file(name, draw, result, writer.SHARP)) else {}
        elif name not in omit:
            contents[name] = partial(writer.picture_file, name, draw, result, **look)
    contents |= drawn
    return contents | ({view.PAGE: partial(view.page, result, drawn, **look)} if hasattr(view, "PAGE") else {})


def picture(result: Any, **look: Any) -> bytes:
    """The first picture of a result as PNG."""
    name, draw = next(iter(pictures_of(result.shown_by).items()))
    content: bytes = _writer().picture_file(name, draw, result, **look)
    return content


def figure(result: Any, name: str = "", **look: Any) -> Figure | None:
    """A picture of a result as a figure, by default the first that shows something; None if none does."""
    with _writer().house_style():
        draws = (draw for file, draw in pictures_of(result.shown_by).items() if name in ("", file))
        return next(filter(None, (draw(result, **look) for draw in draws)), None)
