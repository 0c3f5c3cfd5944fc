"""The pictures of docs/studio.md: `python docs/studio_pictures.py` (playwright and a Chromium are needed)."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from playwright.sync_api import Page, sync_playwright

ROOT = Path(__file__).parents[1]
IMAGES = ROOT / "docs" / "images"
EFFECT = "joint_moment_stiffness"  # that `make studio` hides
BROWSERS = ("chromium", "chromium-browser", "google-chrome")


def idle(page: Page) -> None:
    """Wait until nothing runs beside the page."""
    for _ in range(1200):
        page.wait_for_timeout(300)
        if page.is_hidden("#cancel"):
            return
    raise SystemExit("the studio is still at work")


def journey(page: Page, address: str) -> None:
    """The steps of docs/studio.md, a picture after each."""

    def shot(name: str) -> None:
        page.evaluate("document.activeElement.blur()")
        page.wait_for_timeout(600)
        page.screenshot(path=IMAGES / f"studio_{name}.png")

    page.goto(address)
    page.wait_for_selector("#sentence small")
    idle(page)
    shot("verdict")
    page.click("#guided")
    page.click(f"label[for=sw-{EFFECT}]")
    page.wait_for_selector(f"#sw-{EFFECT}:checked")
    page.click("#fit")
    page.wait_for_selector("#fit-text")
    idle(page)
    page.click("[data-focus=part]")
    shot("fitted")
    page.click("#tab-placement")
    page.wait_for_selector("#drag")
    page.click("[data-focus=machine]")
    page.click("#best")
    page.wait_for_selector("button[id^=use-]")
    page.click("button[id^=use-]")
    idle(page)
    page.evaluate("document.querySelector('.right').scrollTop = 0")
    shot("placement")
    page.click("#tab-exercise")
    page.select_option("#claim", EFFECT)
    page.click("#reveal")
    page.wait_for_selector("#revealed")
    page.click("[data-focus=work]")
    shot("revealed")
    page.set_viewport_size({"width": 390, "height": 844})
    page.click("#tab-effects")
    page.wait_for_timeout(500)
    page.screenshot(path=IMAGES / "studio_phone.png", full_page=True)
    print(f"a phone scrolls {page.evaluate('document.documentElement.scrollHeight / innerHeight'):.1f} screens")


def main() -> None:
    """Start a studio on an exercise, walk through it, end it."""
    import shutil

    browser = next(filter(None, map(shutil.which, BROWSERS)))
    with tempfile.TemporaryDirectory() as folder:
        words = [sys.executable, "-m", "toolpath_stiff", "studio", "--case", f"{folder}/exercise", "--no-browser"]
        words += ["--exercise", "52", "--program", str(ROOT / "programs" / "pocket.nc")]
        studio = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
        assert studio.stdout is not None
        address = next(line.split()[1] for line in studio.stdout if re.match("studio", line))
        try:
            with sync_playwright() as playwright:
                chromium = playwright.chromium.launch(executable_path=browser, args=["--no-sandbox"])
                page = chromium.new_page(viewport={"width": 1400, "height": 900})
                page.set_default_timeout(300_000)
                journey(page, address)
                chromium.close()
        finally:
            studio.terminate()
            studio.wait()
            time.sleep(0.2)


if __name__ == "__main__":
    main()
