"""Pages in a headless Chromium, where there is one."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from matplotlib import colormaps
from matplotlib.colors import to_hex

from toolpath_stiff.report.colours import CLASSES

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "chrome"))), None)
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium here")

# Every opaque colour of each drawing, with the lowest row that has it, on the element itself.
PAINTED = """
for (const stage of document.querySelectorAll(".stage")) {
  const canvas = stage.querySelector("canvas"), rows = new Map();
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const hex = (v) => v.toString(16).padStart(2, "0"), rowOf = (i) => Math.floor(i / 4 / canvas.width);
  for (let i = 0; i < pixels.length; i += 4) if (pixels[i + 3] === 255)
    rows.set("#" + hex(pixels[i]) + hex(pixels[i + 1]) + hex(pixels[i + 2]), rowOf(i));
  stage.dataset.painted = [...rows].map((entry) => entry.join(":")).join(" ");
}
"""


def viridis(low: float, high: float) -> list[str]:
    """Colours of the classes of a page's scale, weakest first, as matplotlib has them; on dark from 0.22 to 1."""
    return [to_hex(colour) for colour in colormaps["viridis"](np.linspace(low, high, CLASSES))]


def opened(address: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """What Chromium makes of a page: its document on stdout, its console on stderr."""
    options = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--virtual-time-budget=3000"]
    return subprocess.run(
        [str(BROWSER), *options, f"--user-data-dir={folder / 'profile'}", "--dump-dom", address],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip


def run_in(page: str, script: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """The page opened with a script at its end; without its policy, which forbids this script as any other."""
    file = folder / "report.html"
    text = re.sub("<meta http-equiv[^>]*>", "", page).replace("</body>", f"<script>{script}</script></body>")
    # Drawn at once instead of with the next frame, which may be late on a busy machine.
    text = text.replace("<head>", "<head><script>window.requestAnimationFrame = (draw) => draw();</script>")
    file.write_text(text, encoding="utf-8")
    return opened(file.as_uri(), folder)


def painted(page: str, folder: Path, script: str = "") -> dict[str, dict[str, int]]:
    """Drawing -> the lowest row of pixels, counted from above, of each opaque colour; after a script has run."""
    done = run_in(page, f"{script};{PAINTED}", folder)
    assert "CONSOLE" not in done.stderr
    found = re.findall(r'id="(\w+)" data-painted="([^"]*)"', done.stdout)
    return {name: {c: int(row) for c, row in (pair.split(":") for pair in text.split())} for name, text in found}
