"""The studio's page: one document with its own scripts and styles, live or exported with the state in it."""

import html
from importlib import resources

from toolpath_stiff.defaults import VERSION
from toolpath_stiff.report.pages import asset, json_pieces, script_hash
from toolpath_stiff.studio.picture import document
from toolpath_stiff.studio.session import Session

SHARED = ("stage.js", "elements.js", "viewer.js", "solids.js", "machine.js", "profile.js", "listing.js")
OWN = ("scene.js", "panels.js", "studio.js")


def page() -> str:
    """The live page, without any state or token."""
    return _document("null", "connect-src 'self'; ", "toolpath_stiff studio")


def exported(session: Session) -> str:
    """The case as one file that needs neither the studio nor a network."""
    return _document("".join(json_pieces(document(session))), "", f"{session.name}: a case of toolpath_stiff")


def _document(state: str, connect: str, title: str) -> str:
    text = "".join([*map(asset, SHARED), *map(_own, OWN)])
    script = f'\n"use strict";\n(() => {{\n{text}}})();\n'
    policy = (
        f"default-src 'none'; script-src '{script_hash(script)}'; style-src 'unsafe-inline'; img-src data:; {connect}"
        "base-uri 'none'; form-action 'none'"
    )
    body = _own("studio.html").replace("VERSION", VERSION)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="color-scheme" content="light dark">\n<link rel="icon" href="data:,">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{asset('page.css')}{asset('viewer.css')}{_own('studio.css')}</style>\n</head>\n<body>\n"
        f'{body}<script type="application/json" id="state">{state}</script>\n'
        f"<script>{script}</script>\n</body>\n</html>\n"
    )


def _own(name: str) -> str:
    return resources.files("toolpath_stiff.studio").joinpath("assets", name).read_text(encoding="utf-8")
