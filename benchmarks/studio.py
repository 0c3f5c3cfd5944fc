"""`python -m benchmarks.studio`: how quickly the studio answers, in a browser without a graphics card.

A blind exercise of 288 readings, then a campaign of 5,000; a program of 10,000 samples and one of
50,000 lines. Medians and the slowest of many, seen from the page: from the question until the answer is drawn, and
from one frame to the next while the machine turns. Absolute times: they are what a hand at a slider feels.
"""

import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from benchmarks.diagnosis_cases import campaign
from benchmarks.pages import bar, page_parser, table, tell

ANSWER_BAR, LARGE_BAR, FRAME_BAR = 30.0, 100.0, 50.0  # ms, medians
ROUNDS = 40
PATIENCE = 600_000  # ms
TURNING = """async (rounds) => {
  const stage = document.querySelector('#scene .overlay'), times = [];
  stage.focus();
  let last = performance.now();
  for (let k = 0; k < rounds; k++) {
    stage.dispatchEvent(new KeyboardEvent('keydown', {key: 'ArrowRight', bubbles: true}));
    await new Promise(requestAnimationFrame);
    const now = performance.now();
    times.push(now - last);
    last = now;
  }
  return times;
}"""
ASKING = """async ([questions]) => {
  const times = [];
  for (const question of questions) {
    const began = performance.now();
    const answer = await fetch('/do', {method: 'POST', headers: {'Content-Type': 'application/json'},
      body: JSON.stringify(question)});
    const found = await answer.json();
    if (found.error) throw new Error(found.error);
    await new Promise(requestAnimationFrame);
    times.push(performance.now() - began);
  }
  return times;
}"""


@contextmanager
def studio(folder: Path, *words: str) -> Iterator[str]:
    """A running studio; its address."""
    command = [sys.executable, "-m", "toolpath_stiff", "studio", "--case", str(folder), "--no-browser", *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        yield next(line.split()[1] for line in iter(process.stdout.readline, "") if line.startswith("studio"))
    finally:
        process.terminate()
        process.wait(60)


def programs(folder: Path) -> tuple[Path, Path]:
    """A program of 10,000 samples at 1 mm, and one of 50,000 lines."""
    rows = "".join(f"X{100 * (i % 2)} Y{i % 90}\n" for i in range(71))
    long, many = folder / "long.nc", folder / "many.nc"
    long.write_text(f"G21 G90 F1000\nG0 X0 Y0 Z0\nG1 Z-1\n{rows}M2\n")
    small = "".join(f"X{(i % 200) * 0.5:g} Y{(i // 200) * 0.4:g}\n" for i in range(50_000))
    many.write_text(f"G21 G90 F1000\nG0 X0 Y0 Z0\nG1 Z-1\n{small}M2\n")
    return long, many


def row(name: str, times: list[float], most: float) -> tuple[tuple[str, ...], bool]:
    """A row of the table, and whether its bar is cleared."""
    clears = statistics.median(times) < most
    figures = (f"{statistics.median(times):.0f}", f"{max(times):.0f}")
    return (name, *figures, bar(clears, f"under {most:g}")), clears


def measure(browser: Any, folder: Path) -> list[tuple[tuple[str, ...], bool]]:
    """All rows of the table."""
    long, many = programs(folder)
    own = ("--exercise", "7", "--program", str(long))
    (folder / "many.csv").write_text(campaign(5000))
    large = (str(folder / "many.csv"), "--program", str(many))
    return [
        *measure_one(browser, folder / "288", own, "288 readings", "10,000 samples", ANSWER_BAR),
        *measure_one(browser, folder / "5000", large, "5,000 readings", "50,000 lines", LARGE_BAR),
    ]


def measure_one(
    browser: Any, case: Path, words: tuple[str, ...], readings: str, program: str, most: float
) -> list[tuple[tuple[str, ...], bool]]:
    """The rows of one case. The diagnosis beside the page is stopped: it is not what is measured."""
    hand = [{"do": "hand", "on": {"weak_strut": {"strut": 4, "factor": 0.7 + 0.005 * k}}} for k in range(ROUNDS)]
    on = {"do": "switch", "effect": "weak_strut", "values": {"strut": 4, "factor": 0.8}}
    at = [{"do": "at", "origin": [k, -k, 800, 0, 0, 2 * k]} for k in range(ROUNDS)]
    with studio(case, *words) as address:
        page = browser.new_page(viewport={"width": 1400, "height": 900})
        page.goto(address)
        page.wait_for_selector("#sw-table_compliance", state="attached", timeout=PATIENCE)
        page.click("#cancel")
        page.evaluate(ASKING, [[on]])
        page.wait_for_selector("#profile-card:not([hidden])", timeout=PATIENCE)
        found = []
        for what, questions in ((f"{readings}: a size moved by hand", hand), (f"{program}: the work dragged", at)):
            page.evaluate(ASKING, [questions[:2]])
            found.append(row(what, page.evaluate(ASKING, [questions]), most))
        times = page.evaluate(TURNING, ROUNDS)
        page.close()
    return [*found, row(f"{readings}, {program}: a frame while turning", times[1:], FRAME_BAR)]


def main() -> int:
    """Measure, print, exit with 1 where a bar is not cleared."""
    args = page_parser("benchmarks.studio", __doc__).parse_args()
    from playwright.sync_api import sync_playwright

    from tests.browser import BROWSER

    with sync_playwright() as started, tempfile.TemporaryDirectory() as folder:
        browser = started.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
        rows = measure(browser, Path(folder))
        browser.close()
    rows_of_table = table("what | ms, median: | ms, slowest: | bar", [cells for cells, _ in rows])
    text = "\n".join(["# The studio's answers", "", *rows_of_table])
    return tell(text, args, "python -m benchmarks.studio", all(clears for _, clears in rows))


if __name__ == "__main__":
    sys.exit(main())
