"""The documentation site, built once: no warning, nothing from another host, every name that the code knows."""

from __future__ import annotations

import argparse
import importlib.util
import json
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import toolpath_stiff
from tests.browser import needs_browser, opened
from toolpath_stiff.cli.main import MODULES as COMMANDS
from toolpath_stiff.nc.codes.registry import CODES, REFUSED
from toolpath_stiff.nc.cutter_location.vocabulary import WORDS
from toolpath_stiff.stiffness.catalogue import packaged_effects

pytest.importorskip("sphinx")
ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
QUICK = DOCS / "quick_build.py"
SPEC = importlib.util.spec_from_file_location("from_code", DOCS / "from_code.py")
from_code = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(from_code)
# Tags that make a browser fetch something, and where from; `a` waits for a click.
FETCHED = {"script": "src", "img": "src", "iframe": "src", "source": "src", "link": "href", "object": "data"}
PAGES = sorted({*DOCS.glob("*.md"), *DOCS.glob("[!_]*/*.md"), *ROOT.glob("*.md"), *ROOT.glob("[bpr]*/**/*.md")})
PAGES = [page for page in PAGES if page.parent not in (DOCS / "api", DOCS / "commands")]


class Page(HTMLParser):
    """What a page fetches, where it leads to, and the places that one can lead to."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.fetched: list[str] = []
        self.links: list[str] = []
        self.places: set[str] = set()
        self.text: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = dict(attributes)
        self.places |= {str(values[name]) for name in ("id", "name") if values.get(name)}
        if tag == "a" and values.get("href"):
            self.links.append(str(values["href"]))
        if tag in FETCHED and values.get(FETCHED[tag]):
            self.fetched.append(str(values[FETCHED[tag]]))

    def handle_data(self, data: str) -> None:
        self.text.append(data)


@pytest.fixture(scope="module")
def site(tmp_path_factory) -> Path:
    """The site, from nothing: a warning fails the build."""
    out = tmp_path_factory.mktemp("site")
    words = ["--fail-on-warning", "--keep-going", "--quiet", "-c", DOCS, "-d", out / "doctrees", ROOT, out / "html"]
    done = subprocess.run([sys.executable, QUICK, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return out / "html"


@pytest.fixture(scope="module")
def pages(site) -> dict[Path, Page]:
    """File -> page of the site."""
    return {
        path: Page(path.read_text("utf-8"))
        for path in sorted(site.rglob("*.html"))
        if "_static" not in path.parts and "_downloads" not in path.parts
    }


def shown(pages: dict[Path, Page], name: str) -> str:
    return "".join(next(page for path, page in pages.items() if path.match(name)).text)


def test_nothing_is_fetched_from_another_host(site, pages):
    foreign = [(path.name, url) for path, page in pages.items() for url in page.fetched if re.match("[a-z]+:|//", url)]
    assert [found for found in foreign if not found[1].startswith("data:")] == []
    for style in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import)\s*['\"]?(?:https?:)?//[^)'\"]+", style.read_text("utf-8")) == [], style


def test_every_link_of_the_site_leads_somewhere(pages):
    lost = []
    for path, page in pages.items():
        for link in [*page.links, *page.fetched]:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            there = target.is_file() and (
                not parts.fragment or target not in pages or unquote(parts.fragment) in pages[target].places
            )
            if not there:
                lost.append(f"{path.name}: {link}")
    assert lost == []


def slugs(page: Path) -> set[str]:
    """The anchors that GitHub gives to the headings of a page."""
    text = re.sub(r"^(```|~~~).*?^\1", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    headings = re.findall(r"^#+ +(.+?) *$", text, flags=re.MULTILINE)
    plain = [re.sub(r"[^\w\- ]", "", re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)) for heading in headings]
    return {heading.strip().lower().replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_every_link_of_a_checkout_leads_somewhere(page):
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    for link in re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`\n]*`", "", text)):
        parts = urlsplit(link)
        if parts.scheme or (page.parent == DOCS and link.startswith(f"{page.stem}/")):  # made with the site
            continue
        target = (page.parent / parts.path).resolve() if parts.path else page
        assert target.exists(), link
        assert not parts.fragment or parts.fragment in slugs(target), link


def test_effects_are_listed_in_full(pages):
    text = shown(pages, "docs/effects_catalogue.html")
    for name, effect in packaged_effects().items():
        assert name in text
        assert effect.equation in text
        assert all(p.key in text and p.source in text for p in effect.parameters)


def test_codes_and_words_are_listed(pages):
    text = shown(pages, "docs/nc.html")
    assert [name for name in (*CODES, *REFUSED, *WORDS) if name not in text] == []


def test_commands_and_their_options_are_listed(pages):
    assert {path.stem for path in pages if path.parent.name == "commands"} == set(COMMANDS)
    for command in COMMANDS:
        assert f"tps {command}" in shown(pages, "docs/commands.html")
        assert f"tps {command}" in shown(pages, f"docs/commands/{command}.html")
    assert "tps machine from-linuxcnc" in shown(pages, "docs/commands/machine.html")
    for page, option in (("place", "--keep-out"), ("analyze", "--rs274"), ("update", "--strut-law")):
        assert option in shown(pages, f"docs/commands/{page}.html")


def test_the_notebook_goes_round_the_loop(pages):
    """It is executed: an error in a cell fails the build. The data settle what is missing, and the rig agrees."""
    text = shown(pages, "docs/notebooks/measuring_loop.html")
    assert "AMBIGUOUS" in text
    assert text.index("AMBIGUOUS") < text.index("IDENTIFIED") < text.index("UPDATED")
    assert "('right', 'tool_length_error'" in text
    assert "<Figure" not in text
    page, path = next((page, path) for path, page in pages.items() if path.match("docs/notebooks/measuring_loop.html"))
    (file,) = [path.parent / link for link in page.links if link.endswith("measuring_loop.ipynb")]
    cells = json.loads(file.read_text("utf-8"))["cells"]  # what opens in Jupyter, with what it gave
    assert any(cell["cell_type"] == "code" and "tps.update(" in "".join(cell["source"]) for cell in cells)


def test_public_names_have_a_page(pages):
    made = {path.stem for path in pages if path.parent.name == "api"}
    assert made == {name for name in toolpath_stiff.__all__ if not name.startswith("_")}


@pytest.mark.parametrize("page", sorted(DOCS.glob("*.md")), ids=lambda page: page.stem)
def test_what_is_committed_of_the_code_is_up_to_date(page):
    text = page.read_text("utf-8")
    assert from_code.fill(text, from_code.COMMITTED) == text, "make it again: python docs/from_code.py"


def test_help_is_safe_within_markdown():
    parser = argparse.ArgumentParser(prog="tps try")
    parser.add_argument(
        "--out", metavar="DIR", default="a_b", help="into <name>, *all*, `as_it_is` (default: %(default)s)"
    )
    page = "\n".join(from_code._command(parser, "try", 3))
    assert "`--out DIR`\n: into \\<name\\>, \\*all\\*, `as_it_is` (default: a\\_b)" in page


@needs_browser
def test_a_page_of_the_site_says_nothing_to_the_console(site, tmp_path):
    done = opened((site / "docs" / "index.html").as_uri(), tmp_path)
    said = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in said if "Changed to auto mode" not in line] == []  # an error, as of a theme it has not
