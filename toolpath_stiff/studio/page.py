"""The studio's page: one document with its own scripts and styles, live or exported with the state in it."""

from typing import Any

from toolpath_stiff.report.pages import render
from toolpath_stiff.studio.picture import document
from toolpath_stiff.studio.session import Session

STYLES = ("viewer.css", "studio/studio.css")
SHARED = ("stage.js", "elements.js", "viewer.js", "solids.js", "machine.js", "profile.js", "listing.js")
OWN = ("studio/scene.js", "studio/panels.js", "studio/studio.js")


def page() -> str:
    """The live page, without any state or token."""
    return _page("toolpath_stiff studio", connect="connect-src 'self'; ")


def exported(session: Session) -> str:
    """The case as one file that needs neither the studio nor a network."""
    return _page(f"{session.name}: a case of toolpath_stiff", data=document(session))


def _page(title: str, **more: Any) -> str:
    return "".join(render("studio/studio.html", styles=STYLES, scripts=(*SHARED, *OWN), title=title, **more))
