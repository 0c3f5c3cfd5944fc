"""The studio: who may ask, what a page is told, and the whole journey in a browser on a blind exercise."""

from __future__ import annotations

import http.client
import json
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import toolpath_stiff as tps
from tests.browser import BROWSER
from toolpath_stiff.cli.main import main
from toolpath_stiff.rig import exercise as rig

SLOT = "G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X40\nG1 Y30\nM2\n"
SEED, LAYOUT = 9006, "paper"
PATIENCE = 180_000  # ms: on a busy machine everything is slow


class Running:
    """A studio in a process of its own."""

    def __init__(self, folder: Path, *more: str) -> None:
        self.folder = folder
        words = [sys.executable, "-m", "toolpath_stiff", "studio", "--case", str(folder), "--no-browser", *more]
        self.process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.told = ""
        for line in iter(self.process.stdout.readline, ""):
            if line.startswith("studio"):
                self.address = line.split()[1]
                break
            self.told += line
        self.port = int(re.search(r":(\d+)/", self.address)[1])
        self.token = self.address.partition("token=")[2]

    def ask(self, method: str, path: str, body: bytes = b"", **headers: str) -> tuple[int, bytes, dict[str, str]]:
        host = f"127.0.0.1:{self.port}"
        given = {"Host": host, "Cookie": f"tps_studio_{self.port}={self.token}"}
        if method == "POST":
            given["Origin"] = f"http://{host}"
        given |= {name.replace("_", "-"): value for name, value in headers.items()}
        link = http.client.HTTPConnection("127.0.0.1", self.port, timeout=120)
        link.request(method, path, body, {name: value for name, value in given.items() if value})
        answer = link.getresponse()
        content = answer.read()
        link.close()
        return answer.status, content, dict(answer.getheaders())

    def do(self, **asked: object) -> dict[str, object]:
        return json.loads(self.ask("POST", "/do", json.dumps(asked).encode())[1])

    def state(self) -> dict[str, object]:
        return json.loads(self.ask("GET", "/state")[1])

    def idle(self) -> dict[str, object]:
        for _ in range(600):
            found = self.state()
            if not found["job"]:
                return found
            time.sleep(0.2)
        raise AssertionError(f"still at {found['job']}")

    def end(self) -> None:
        self.process.send_signal(signal.SIGTERM)
        self.process.wait(30)


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    """A studio on an empty case."""
    found = Running(tmp_path_factory.mktemp("studio") / "case")
    yield found
    found.end()


@pytest.fixture
def fresh(tmp_path):
    """A studio on an empty case of its own."""
    found = Running(tmp_path / "case")
    yield found
    found.end()


@pytest.fixture(scope="module")
def exercised(tmp_path_factory):
    """A studio with a judged exercise and a program; each test takes back what it does."""
    found = Running(tmp_path_factory.mktemp("exercised") / "case")
    found.do(do="exercise", seed=SEED, layout=LAYOUT)
    found.ask("POST", "/file?name=slot.nc", SLOT.encode())
    found.idle()
    yield found
    found.end()


# -- who may ask -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("method", "path", "headers"),
    [
        ("GET", "/state", {"Cookie": ""}),
        ("GET", "/", {"Cookie": ""}),
        ("GET", "/?token=wrong", {"Cookie": ""}),
        ("GET", "/state", {"Cookie": "tps_studio_1=wrong"}),
        ("GET", "/state", {"Host": "studio.example"}),
        ("GET", "/state", {"Host": "127.0.0.1"}),
        ("GET", "/state", {"Origin": "http://studio.example"}),
        ("GET", "/events", {"Origin": "null"}),
        ("POST", "/do", {"Origin": "http://127.0.0.1:1"}),
        ("POST", "/do", {"Origin": ""}),
        ("POST", "/do", {"Sec_Fetch_Site": "cross-site"}),
        ("POST", "/file?name=a.csv", {"Cookie": ""}),
        ("GET", "/export", {"Cookie": ""}),
    ],
)
def test_strangers_are_refused(running, method, path, headers):
    status, content, _ = running.ask(method, path, b"{}", **headers)
    assert status == 403
    assert running.token.encode() not in content


def test_the_token_goes_into_a_cookie_that_scripts_and_other_sites_do_not_get(running):
    status, _, headers = running.ask("GET", f"/?token={running.token}", Cookie="")
    assert status == 303
    assert headers["Location"] == "/"
    assert "HttpOnly" in headers["Set-Cookie"]
    assert "SameSite=Strict" in headers["Set-Cookie"]


@pytest.mark.parametrize(
    "path", ["../case.json", "%2e%2e/secret.csv", "/etc/passwd", "exercise/machine.toml", "case", "results/../../x.csv"]
)
def test_nothing_outside_the_case_and_not_the_seal(running, path):
    (running.folder.parent / "secret.csv").write_text("secret")
    assert running.ask("GET", f"/case/{path}")[0] == 404


def test_pages_of_results_have_an_origin_of_their_own(running):
    (running.folder / "results").mkdir(exist_ok=True)
    (running.folder / "results" / "page.html").write_text("<script>fetch('/state')</script>")
    status, _, headers = running.ask("GET", "/case/results/page.html")
    assert (status, headers["Content-Security-Policy"]) == (200, "sandbox allow-scripts")


def test_large_bodies_are_refused_before_they_are_read(running):
    assert running.ask("POST", "/do", Content_Length="99999999")[0] == 413
    assert running.ask("POST", "/file?name=a.csv", Content_Length=str(2**40))[0] == 413


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"do": "format"}, "unknown action"),
        ({"do": "aside", "file": "../x.csv", "line": 3}, ""),
        ({"do": "switch", "effect": "ghost", "values": {}}, ""),
        ({"do": "claim", "effects": "weak_strut"}, "sealed"),
        ({"do": "fit"}, "no effect is switched on"),
        ({"do": "place", "x_mm": 0, "out": "/tmp"}, "unexpected"),
        ({"do": "undo", "what": 1}, "undo"),
        ({"do": "require", "value": "nan"}, "require nan"),
        ({"do": "place_at", "origin": [1, 2]}, "2 numbers"),
        ({"do": "place_at", "origin": ["nan", 0, 0]}, "finite"),
        ({"do": "place_at", "origin": [10**400, 0, 0]}, "finite"),
        ({"do": "switch", "effect": "weak_strut", "values": 5}, "switch"),
        ({"do": "hand", "on": 5}, ""),
    ],
)
def test_what_cannot_be_done_is_said(running, asked, said):
    answer = running.do(**asked)
    assert said in answer["error"]


@pytest.mark.parametrize(
    "body",
    [
        b'{"do": "plan", "n": 1e400}',
        b'{"do": "plan", "n": NaN}',
        b'{"do": "require", "value": -Infinity}',
        b'{"do": "hand", "on": {"weak_strut": {"strut": 1, "factor": 1e999}}}',
        b'{"do": "plan", "n": ' + 5000 * b"9" + b"}",
        100_000 * b"[",
        b"\xff",
        b"",
    ],
)
def test_numbers_of_a_question_are_finite_and_it_is_json(running, body):
    status, content, _ = running.ask("POST", "/do", body)
    assert (status, "error" in json.loads(content)) == (200, True)
    assert running.ask("GET", "/state")[0] == 200


@pytest.mark.parametrize(
    "name", ["a" * 300 + ".nc", "%00.nc", "a%00b.csv", "%C3%A9" * 120, "b." + "c" * 190, "..", "%FF"]
)
def test_whatever_a_file_is_called_there_is_an_answer(running, name):
    status, content, _ = running.ask("POST", f"/file?name={name}", b"G5.9 X\n")
    assert (status, "error" in json.loads(content)) == (200, True)
    assert running.ask("GET", f"/case/{name}")[0] == 404


def test_a_program_with_tool_lengths_by_dropped_files(running):
    program = b"G21 G90\nT5 M6\nG0 X0 Y0\nG43 H5 Z5\nG1 Z0 F300\nG1 X40\nM2\n"

    def drop(name: str, content: bytes) -> dict[str, str]:
        return json.loads(running.ask("POST", f"/file?name={name}", content)[1])

    assert "no tool table" in drop("long.nc", program)["error"]
    for name, content, key in (
        ("my.tbl", b"T5 P5 Z120\n", "tools"),
        ("tools.csv", b"tool,length_mm\n5,130\n", "tools"),
        ("mill.var", b"5221 10\n", "offsets"),
        ("control.toml", b'dialect = "linuxcnc"\n', "controller"),
    ):
        assert "message" in drop(name, content), name
        assert tps.Case.open(running.folder).state.reading[key] == f"programs/{name}"
    assert "message" in drop("long.nc", program)
    case = tps.Case.open(running.folder)
    assert case.program.request.controller.tools[5].length == 130
    assert case.program.request.controller.label == "linuxcnc"
    assert running.idle()["program"]["error"] == ""
    for _ in range(5):
        running.do(do="undo")
    assert tps.Case.open(running.folder).state.reading == {}


def test_the_command_takes_what_a_program_is_read_with(tmp_path):
    (tmp_path / "long.nc").write_text("G21 G90\nT5 M6\nG0 X0 Y0\nG43 H5 Z5\nG1 Z0 F300\nG1 X40\nM2\n")
    (tmp_path / "my.tbl").write_text("T5 P5 Z120\n")
    words = ("--program", tmp_path / "long.nc", "--tools", tmp_path / "my.tbl", "--dialect", "linuxcnc")
    studio = Running(tmp_path / "case", *map(str, words))
    try:
        state = studio.idle()
        assert state["program"]["path"]["samples"] > 40
        assert "--dialect linuxcnc --tools programs/my.tbl" in state["history"][-1]["command"]
    finally:
        studio.end()


@pytest.fixture
def from_elsewhere(tmp_path, monkeypatch):
    """A case of another user with code of theirs in three places; the file that each of them would write."""
    marker = tmp_path / "marker"
    evil = f"from pathlib import Path\n\nPath({str(marker)!r}).write_text('ran')\n"
    (tmp_path / "my_screw.py").write_text(evil + tps.effect_template("my_screw").text)
    (tmp_path / "slot.nc").write_text(SLOT)
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "sender"))
    case = tps.Case.open(tmp_path / "case")
    case.add_effects(tmp_path / "my_screw.py")
    case.add_program(tmp_path / "slot.nc")
    for name in ("pandas.py", "multiprocessing.py", "sitecustomize.py"):
        (case.folder / name).write_text(evil)
    marker.unlink()
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "mine"))
    return shutil.copytree(case.folder, tmp_path / "moved"), marker


def test_a_case_from_elsewhere_runs_nothing_until_this_user_agrees(from_elsewhere, capsys):
    folder, marker = from_elsewhere
    assert main(["studio", "--no-browser", "--case", str(folder)]) == 2
    told = capsys.readouterr().err
    assert "effects/my_screw.py is code that came with the case" in told
    assert f"tps studio --case {folder} --trust effects/my_screw.py" in told and not marker.exists()
    studio = Running(folder, "--trust", "effects/my_screw.py")
    try:
        state = studio.idle()
        assert marker.exists() and "my_screw" in [one["name"] for one in state["effects"]]
        assert "my_screw" in [one["name"] for one in state["effects"]] and state["program"]["path"]
    finally:
        studio.end()
    Running(folder).end()  # from now on


def test_code_is_loaded_on_an_explicit_yes_alone(running, tmp_path):
    body = tps.effect_template("my_screw").text.encode()
    status, content, _ = running.ask("POST", "/file?name=my_screw.py", body)
    assert status == 200
    assert "my_screw.py is code" in json.loads(content)["confirm"]
    assert not (running.folder / "effects" / "my_screw.py").exists()


def test_a_broken_effect_is_told_with_its_line(running):
    text = "from toolpath_stiff import Effect\n\nclass Screw(Effect):\n    name = 1 +\n"
    status, content, _ = running.ask("POST", "/file?name=screw.py&run=yes", text.encode())
    assert status == 200
    said = json.loads(content)["error"]
    assert "screw.py" in said
    assert "4" in said
    assert running.state()["history"][-1]["kind"] != "effects"


def test_an_own_effect_that_is_dropped_again_is_replaced(exercised, browser, tmp_path):
    text = tps.effect_template("my_screw").text
    title = re.search(r'title = "([^"]*)"', text)[1]
    tab = Tab(browser, exercised.address)
    page = tab.page
    page.wait_for_selector("#sw-table_compliance", state="attached")
    label = "document.querySelector('label[for=sw-my_screw]')"
    versions = (
        (text, f"{label}?.textContent.includes({json.dumps(title)})"),
        (text.replace("link =", "link = = ", 1), "document.querySelector('#message').textContent.includes('syntax')"),
        (text.replace(title, "the screws of the shop give way"), f"{label}.textContent.includes('screws of the shop')"),
    )
    for folder, (written, seen) in enumerate(versions):
        file = tmp_path / f"{folder}" / "my_screw.py"
        file.parent.mkdir()
        file.write_text(written)
        page.set_input_files("#file", file)
        page.wait_for_selector("#ask[open]")
        page.click("#yes")
        tab.until(seen)
    assert tps.Case.open(exercised.folder).state.effects == ("effects/my_screw-2.py",)
    # Undone, the first one is back, and gone.
    page.click("#undo")
    tab.until(f"{label}.textContent.includes({json.dumps(title)})")
    page.click("#undo")
    tab.until("document.querySelector('#sw-my_screw') === null")
    assert tab.faults == []
    tab.close()


# -- the journey -------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def browser():
    playwright = pytest.importorskip("playwright.sync_api")
    if BROWSER is None:
        pytest.skip("no Chromium here")
    with playwright.sync_playwright() as started:
        found = started.chromium.launch(executable_path=BROWSER, args=["--no-sandbox", "--disable-gpu"])
        yield found
        found.close()


class Tab:
    """A tab that notes what it may not have: messages of the console, errors, requests to another host."""

    def __init__(self, browser, address: str, **options) -> None:
        # Without motion: while the work lasts, a turning sign would be painted sixty times a second.
        quiet = {"viewport": {"width": 1400, "height": 900}, "reduced_motion": "reduce"}
        self.page = browser.new_context(**{**quiet, **options}).new_page()
        self.page.set_default_timeout(PATIENCE)
        self.faults: list[str] = []
        self.page.on("console", lambda message: self.faults.append(f"console: {message.text}"))
        self.page.on("pageerror", lambda error: self.faults.append(f"error: {error}"))
        host = address.split("/")[2]
        self.page.on(
            "request",
            lambda asked: (
                asked.url.split("/")[2:3] != [host]
                and not asked.url.startswith(("data:", "blob:", "file:"))
                and self.faults.append(asked.url)
            ),
        )
        self.page.goto(address)

    def go(self, panel: str) -> None:
        self.page.click(f"#tab-{panel}")

    def text(self, selector: str) -> str:
        return self.page.inner_text(selector)

    def number(self, selector: str) -> float:
        return float(re.sub(r"[^\d.-]", "", self.text(selector)))

    def until(self, script: str) -> None:
        """Wait; by asking again, as the page's policy lets no string be run as code."""
        for _ in range(PATIENCE // 100):
            if self.page.evaluate(script):
                return
            self.page.wait_for_timeout(100)
        raise AssertionError(f"never: {script}")

    def box(self, selector: str) -> dict[str, float]:
        """Where an element stands; asked again where the page was just being drawn anew."""
        for _ in range(PATIENCE // 100):
            if found := self.page.locator(selector).bounding_box():
                return found
            self.page.wait_for_timeout(100)
        raise AssertionError(f"nowhere: {selector}")

    def close(self) -> None:
        self.page.context.close()


def settled(running) -> dict[str, object]:
    time.sleep(0.3)
    return running.idle()


def test_a_page_asks_again_where_an_answer_was_overtaken(tmp_path, browser):
    """All is done, and told, between the moment when the state is answered and that when the page has the answer."""
    studio = Running(tmp_path / "case")
    tab = Tab(browser, studio.address)
    late: list[int] = []

    def overtake(route) -> None:
        answer = route.fetch()
        if not late:
            late.append(answer.status)
            studio.ask("POST", "/file?name=slot.nc", SLOT.encode())
            settled(studio)
        route.fulfill(response=answer)

    try:
        tab.page.route("**/state", overtake)
        tab.page.reload()
        tab.page.wait_for_selector("#which-now")
        assert late == [200]
    finally:
        tab.close()
        studio.end()


def test_the_journey_by_mouse(fresh, browser, tmp_path):
    tab = Tab(browser, fresh.address)
    page = tab.page
    # Start a blind exercise.
    tab.go("exercise")
    page.fill("#seed", str(SEED))
    page.select_option("#layout", LAYOUT)
    page.click("#start-exercise")
    page.wait_for_selector("#g-floor:has-text('%')")
    state = settled(fresh)
    case = tps.Case.open(fresh.folder)
    asked = [case.path(name) for name in case.state.data]
    command = tps.diagnose(asked, case.path(case.state.machine)).to_dict()
    tab.until("document.querySelector('#sentence small') !== null")
    assert state["verdict"]["text"] == command["text"]
    assert tab.number("#g-as_given") == pytest.approx(
        command["baseline"]["as_given"]["mean_abs_error_percent"], abs=0.005
    )
    assert tab.number("#g-refitted") == pytest.approx(command["baseline"]["mean_abs_error_percent"], abs=0.005)
    assert tab.number("#g-floor") == pytest.approx(command["baseline"]["noise_floor_percent"], abs=0.005)
    # Set a reading aside in the machine, and take it back.
    box = tab.box("#scene .overlay")
    spot = page.evaluate("() => { const s = window.tpsStudio.spots(); return s[s.length - 1]; }")
    page.mouse.move(box["x"] + spot[0], box["y"] + spot[1])
    tab.until("document.querySelector('#status').textContent.includes('measured')")
    page.mouse.click(box["x"] + spot[0], box["y"] + spot[1])
    tab.until("document.querySelector('#machine-name').textContent.includes('41 readings')")
    assert len(tps.Case.open(fresh.folder).state.aside) == 1
    page.click("#undo")
    tab.until("document.querySelector('#machine-name').textContent.includes('42 readings')")
    # Switch an effect on, move its size, fit, accept.
    tab.go("effects")
    page.click("label[for=sw-weak_strut]")
    page.wait_for_selector("#weak_strut-factor")
    page.select_option("#weak_strut-strut", "4")
    tab.until("document.querySelector('#weak_strut-strut').value === '4'")
    settled(fresh)
    slider = tab.box("#weak_strut-factor")
    page.mouse.move(slider["x"] + 5, slider["y"] + slider["height"] / 2)
    page.mouse.down()
    page.mouse.move(slider["x"] + 0.4 * slider["width"], slider["y"] + slider["height"] / 2, steps=3)
    page.mouse.up()
    settled(fresh)
    on = tps.Case.open(fresh.folder).state.on
    assert on["weak_strut"]["strut"] == 4
    hand = tps.preview(case.data, case.machine).at(on)["mean_abs_error_percent"]
    tab.until(f"Math.abs(parseFloat(document.querySelector('#g-now').textContent) - {hand}) < 0.006")
    settled(fresh)
    page.click("#fit")
    page.wait_for_selector("#fit-text")
    state = settled(fresh)
    kept = json.loads((fresh.folder / tps.Case.open(fresh.folder).latest("update") / "update.json").read_text())
    assert tab.number("#g-now") == pytest.approx(kept["steps"][-1]["mean_abs_error_percent"], abs=0.006)
    assert state["fit"]["text"] == kept["text"]
    assert state["fit"]["holds"] or kept["verdict"] != "updated"
    # A plan, measured on the exercise's machine.
    tab.go("next")
    page.fill("#poses", "2")
    page.click("#make-plan")
    page.wait_for_selector("#plan-file")
    page.click("#measure")
    tab.until("!document.querySelector('#machine-name').textContent.includes('42 readings')")
    # A program, where it sits, the best place.
    (tmp_path / "slot.nc").write_text(SLOT)
    page.set_input_files("#file", tmp_path / "slot.nc")
    page.wait_for_selector("#p-mean")
    state = settled(fresh)
    case = tps.Case.open(fresh.folder)
    assert tab.number("#p-mean") == pytest.approx(state["program"]["summary"]["mean_N_per_mm"], abs=0.5)
    tab.go("placement")
    box = tab.box("#drag")
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2 - 20, steps=4)
    page.mouse.up()
    tab.until("Math.abs(parseFloat(document.querySelector('#o-Xn').value)) > 20")
    settled(fresh)
    case = tps.Case.open(fresh.folder)
    on = case.machine_with(case.state.on)  # with the effect that is switched on
    there = tps.try_placement(case.program, on).at(case.state.origin)
    assert there != tps.try_placement(case.program, case.machine).at(case.state.origin)
    for name in ("mean", "range", "min"):
        assert tab.number(f"#pl-{name}") == pytest.approx(there[f"{name}_N_per_mm"], abs=0.5)
    assert tab.number("#pl-margin") == pytest.approx(100 * there["margin"], abs=0.05)
    # For the shop floor: every warning, offsets, the set-up sheet, the program for this place.
    page.click("#set-up")
    page.wait_for_selector("#set-up-files")
    kept = json.loads((fresh.folder / tps.Case.open(fresh.folder).latest("set_up") / "placement.json").read_text())
    shown = tab.text("#set-up-files")
    assert all(" ".join(text.split()) in " ".join(shown.split()) for text in kept["warnings"])
    assert kept["offset_blocks"]["linuxcnc"] in shown
    written = page.get_attribute("#set-up-written", "href")
    status, program, _ = fresh.ask("GET", written)
    assert (status, fresh.ask("GET", page.get_attribute("#set-up-sheet", "href"))[0]) == (200, 200)
    again = tps.analyze(tps.Program.from_text(program.decode()), on)
    assert again.mean_N_per_mm == pytest.approx(there["mean_N_per_mm"], rel=1e-6)
    # The best place; a point of the front becomes the placement.
    page.click("#best")
    page.wait_for_selector("button[id^=use-]")
    front = json.loads((fresh.folder / tps.Case.open(fresh.folder).latest("place") / "placement.json").read_text())
    cells = [re.sub(r"[^\d.-]", "", one) for one in page.locator("tr:has(button[id^=use-]) td").all_inner_texts()][:8]
    placed = tps.Case.open(fresh.folder).history[-1]
    assert f"--machine {placed.result}/machine.toml" in placed.command  # which carries what is switched on
    first = front["chosen"]
    keys = ("mean_N_per_mm", "range_N_per_mm", "min_N_per_mm", "x_mm", "y_mm", "z_mm", "rotation_deg")
    assert [float(one) for one in cells[1:]] == pytest.approx([first[key] for key in keys], abs=0.51)
    page.locator("button[id^=use-]").first.click()
    tab.until("document.querySelector('#set-up-files') === null")
    settled(fresh)
    assert tps.Case.open(fresh.folder).state.origin[0] == pytest.approx(first["x_mm"], abs=1e-5)
    # Reveal, export.
    tab.go("exercise")
    page.select_option("#claim", "weak_strut")
    page.click("#reveal")
    page.wait_for_selector("#revealed")
    assert "claim weak_strut: " in tab.text("#revealed")
    tab.go("history")
    assert "tps rig reveal exercise --claim weak_strut" in tab.text("#panel")
    assert tab.faults == []
    tab.close()


# How many times Tab has to be pressed to come from where the focus is to an element; below zero: Shift and Tab.
STEPS = """
(selector) => {
  const every = "a[href], button, input, select, textarea, summary, [tabindex]";
  const stops = [...document.querySelectorAll(every)].filter((one) =>
    one.tabIndex >= 0 && !one.disabled && one.checkVisibility({ visibilityProperty: true }));
  const here = stops.indexOf(document.activeElement), there = stops.findIndex((one) => one.matches(selector));
  if (there < 0) return 0;
  return here < 0 ? there + 1 : there - here;
}
"""


class Keys:
    """A tab without a mouse: everything is reached by Tab, nothing is focused by script."""

    def __init__(self, tab: Tab) -> None:
        self.tab, self.press = tab, tab.page.keyboard.press
        self.choosers: list[Any] = []
        tab.page.on("filechooser", self._asked)

    def _asked(self, chooser: Any) -> None:
        self.choosers.append(chooser)

    def reach(self, selector: str) -> None:
        """Press Tab until the element has the focus, or go back where that is nearer; it must show that it has it."""
        steps = self.tab.page.evaluate(STEPS, selector) or 0
        key = "Shift+Tab" if steps < 0 else "Tab"
        for _ in range(abs(steps) - 1):
            self.press(key)
        for _ in range(150):
            if self.tab.page.evaluate("(one) => document.activeElement.matches(one)", selector):
                ring = "getComputedStyle(document.activeElement).outlineStyle"
                assert self.tab.page.evaluate(ring) != "none", selector
                return
            self.press(key)
        raise AssertionError(f"not reached: {selector}")

    def on(self, selector: str, key: str) -> None:
        self.reach(selector)
        self.press(key)

    def type(self, selector: str, text: str) -> None:
        self.reach(selector)
        if not self.tab.page.evaluate("document.activeElement.matches('select')"):
            self.press("Control+a")
        self.tab.page.keyboard.type(text)

    def stop(self) -> None:
        """End the work beside the page, unless it has ended."""
        while self.tab.page.is_visible("#cancel"):
            here = self.tab.page.evaluate("document.activeElement.id === 'cancel'")
            self.press("Enter" if here else "Tab")

    def go(self, panel: str) -> None:
        self.reach("[role=tab]")
        self.press("Home")
        while not self.tab.page.evaluate("(id) => document.activeElement.id === id", f"tab-{panel}"):
            self.press("ArrowRight")

    def add(self, file: Path) -> None:
        self.on("#open", "Enter")
        for _ in range(PATIENCE // 100):
            if self.choosers:
                return self.choosers.pop().set_files(file)
            self.tab.page.wait_for_timeout(100)
        raise AssertionError("no file chooser")


def test_the_journey_by_keyboard(fresh, browser, tmp_path, monkeypatch, capsys):
    tab = Tab(browser, fresh.address)
    page, keys = tab.page, Keys(tab)
    page.wait_for_selector("[id^=sw-]")
    keys.go("exercise")
    keys.type("#seed", str(SEED))
    keys.type("#layout", "14")
    keys.on("#start-exercise", "Enter")
    tab.until("document.querySelector('#machine-name').textContent.includes('42 readings')")
    settled(fresh)
    tab.until("document.querySelector('#sentence small') !== null")
    # Look at a reading, set it aside, take it back.
    keys.on("#scene .overlay", ".")
    tab.until("document.querySelector('#status').textContent.includes('measured')")
    for key in ("ArrowLeft", "+", "Enter"):
        keys.press(key)
    tab.until("document.querySelector('#machine-name').textContent.includes('41 readings')")
    keys.press("Control+z")
    tab.until("document.querySelector('#machine-name').textContent.includes('42 readings')")
    # Switch on, move the size, fit.
    keys.go("effects")
    keys.on("#sw-weak_strut", "Space")
    page.wait_for_selector("#weak_strut-strut")
    tab.until("document.activeElement.id === 'sw-weak_strut'")
    keys.type("#weak_strut-strut", "4")
    settled(fresh)
    keys.on("#weak_strut-factor", "ArrowLeft")
    state = settled(fresh)
    tab.until("document.activeElement.id === 'weak_strut-factor'")
    step = next(one for one in reversed(state["history"]) if one["kind"] == "switch")
    monkeypatch.chdir(fresh.folder)
    assert main([*shlex.split(step["command"])[1:], "--json", "--no-plots"]) == 0
    by_command = json.loads(capsys.readouterr().out)["baseline"]["mean_abs_error_percent"]
    assert state["gauge"]["now"] == pytest.approx(by_command, rel=1e-6)
    assert tab.number("#g-now") == pytest.approx(by_command, abs=0.005)
    # Plan, download, measure, add the readings.
    keys.go("next")
    keys.type("#poses", "2")
    keys.on("#make-plan", "Enter")
    page.wait_for_selector("#plan-file")
    keys.reach("#plan-file")
    with page.expect_download() as plan:
        keys.press("Enter")
    plan.value.save_as(tmp_path / "plan.csv")
    exercise = tps.Case.open(fresh.folder).state.exercise
    text, _ = rig.measured_again(fresh.folder / exercise, str(tmp_path / "plan.csv"), 1)
    (tmp_path / "measured.csv").write_text(text)
    keys.add(tmp_path / "measured.csv")
    tab.until("!document.querySelector('#machine-name').textContent.includes('42 readings')")
    keys.stop()  # nothing here hangs on the new diagnosis
    assert "case.add_data('measured.csv')" in [one["python"] for one in settled(fresh)["history"]]
    # Fit, accept.
    keys.go("effects")
    keys.on("#fit", "Enter")
    page.wait_for_selector("#fit-text")
    settled(fresh)
    keys.on("#accept:not(:disabled)", "Enter")
    page.wait_for_selector("#sw-weak_strut", state="detached")
    assert page.evaluate("document.activeElement.id") == "panel"  # the button is of no use any more
    # The program, where it sits, the best place.
    (tmp_path / "keys.nc").write_text(SLOT)
    keys.add(tmp_path / "keys.nc")
    tab.until("document.querySelector('#machine-name').textContent.includes('keys.nc')")
    page.wait_for_selector("#p-mean")
    keys.on("#profile .overlay", "ArrowRight")
    tab.until("document.querySelector('#status').textContent.startsWith('line ')")
    settled(fresh)
    keys.go("placement")
    keys.reach("#drag")
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp"):
        keys.press(key)
    settled(fresh)
    origin = tps.Case.open(fresh.folder).state.origin
    assert (origin[0], origin[5]) == (20, 5)
    keys.on("#best", "Enter")
    page.wait_for_selector("button[id^=use-]")
    keys.on("button[id^=use-]", "Enter")
    front = json.loads((fresh.folder / tps.Case.open(fresh.folder).latest("place") / "placement.json").read_text())
    settled(fresh)
    assert tps.Case.open(fresh.folder).state.origin[0] == pytest.approx(front["chosen"]["x_mm"], abs=1e-5)
    # Export, reveal.
    keys.reach("#export")
    with page.expect_download() as exported:
        keys.press("Enter")
    assert exported.value.suggested_filename == "case.html"
    keys.go("exercise")
    keys.type("#claim", "weak_strut")
    keys.on("#reveal", "Enter")
    page.wait_for_selector("#revealed")
    assert "claim weak_strut: " in tab.text("#revealed")
    assert tab.faults == []
    tab.close()


def test_what_no_effect_explains_is_drafted_on_the_page(tmp_path, browser):
    case = tps.Case.open(tmp_path / "case")
    case.start_exercise(5, hidden="saddle_overhang")  # gives way along X as y squared: in no catalogue
    studio = Running(tmp_path / "case")
    tab = Tab(browser, studio.address, viewport={"width": 390, "height": 844}, has_touch=True)
    page = tab.page
    try:
        page.wait_for_selector("#draft")
        assert page.is_visible("#portrait")
        page.tap("#draft")
        page.wait_for_selector("label[for=sw-missing]")
        before = settled(studio)["gauge"]
        page.tap("label[for=sw-missing]")
        page.wait_for_selector("#sw-missing:checked")
        after = settled(studio)["gauge"]
        assert after["now"] < 0.9 * before["as_given"]
        assert "[effect]" in (tmp_path / "case" / tps.Case.open(tmp_path / "case").state.effects[0]).read_text()
        # On a phone the loop takes three screens at most, and what is tapped is large enough.
        assert page.evaluate("document.documentElement.scrollHeight") <= 3 * 844
        small = page.evaluate(SMALL)
        assert (small, tab.faults) == ([], [])
    finally:
        tab.close()
        studio.end()


# Controls in sight that are lower than 32 pixels.
SMALL = """
() => [...document.querySelectorAll("button, input, select, summary, a.button")].filter((one) => one.checkVisibility()
  && one.getBoundingClientRect().height < 32).map((one) => one.outerHTML.slice(0, 90))
"""


def test_one_s_own_machine_is_dropped_and_moves_along_the_path(fresh, tmp_path, browser):
    (tmp_path / "slot.nc").write_text(SLOT)
    robot = Path(__file__).parents[1] / "machine/data/robot200.toml"
    tab = Tab(browser, fresh.address)
    tab.page.set_input_files("#file", [tmp_path / "slot.nc", robot])
    tab.page.wait_for_selector("#message.notice:has-text('program slot.nc')")
    tab.page.wait_for_selector("#machine-name:has-text('robot200')")
    tab.page.wait_for_selector("#which-now")
    scene = fresh.idle()["machine"]["scene"]
    assert [body["name"] for body in scene["bodies"]] == ["J1", "J2", "J3", "J4", "J5", "J6", "tool"]
    assert len(scene["frames"]) > 40
    for focus in ("part", "machine", "work"):
        tab.page.click(f"[data-focus={focus}]")
    tab.page.click("#play")
    tab.until("Number(document.querySelector('#scrub').value) > 3")
    tab.go("placement")
    tab.page.wait_for_selector("#drag")
    assert tab.faults == []
    tab.close()


def test_what_was_stopped_is_said_and_can_be_asked_for_again(fresh, browser):
    fresh.do(do="exercise", seed=SEED, layout=LAYOUT)
    fresh.do(do="cancel")
    tab = Tab(browser, fresh.address)
    tab.page.wait_for_selector("#sentence:has-text('not judged')")
    tab.page.click("#judge")
    tab.page.wait_for_selector("#sentence:not(.waiting)")
    # Ten stops of a slider are one line of the history, whatever was worked out between them.
    for k in range(10):
        fresh.do(do="switch", effect="weak_strut", values={"strut": 4, "factor": 0.7 + 0.01 * k})
    tab.go("history")
    tab.page.wait_for_selector("#panel:has-text('(10 stops)')")
    assert tab.page.locator(".step", has_text="weak_strut on").count() == 1
    assert tab.faults == []
    tab.close()


def test_the_work_is_dragged_by_touch(exercised, browser, tmp_path):
    tab = Tab(browser, exercised.address, viewport={"width": 390, "height": 844}, has_touch=True)
    (tmp_path / "touch.nc").write_text(SLOT)
    tab.page.set_input_files("#file", tmp_path / "touch.nc")
    tab.page.wait_for_selector("#p-mean")
    tab.go("placement")
    tab.page.locator("#drag").scroll_into_view_if_needed()
    box = tab.box("#drag")
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch = tab.page.context.new_cdp_session(tab.page)
    for kind, by in (("touchStart", 0), ("touchMove", 20), ("touchMove", 40), ("touchEnd", None)):
        points = [] if by is None else [{"x": x + by, "y": y}]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
    tab.until("Math.abs(parseFloat(document.querySelector('#o-Xn').value)) > 20")
    settled(exercised)
    assert tps.Case.open(exercised.folder).state.origin[0] > 20
    tab.page.click("#undo")
    tab.page.click("#undo")
    assert tab.faults == []
    tab.close()


def test_two_tabs_see_the_same(exercised, browser):
    one, two = Tab(browser, exercised.address), Tab(browser, exercised.address)
    for tab in (one, two):
        tab.page.wait_for_selector("#sw-table_compliance", state="attached")
    one.page.click("#unlikely > summary")
    one.page.click("label[for=sw-table_compliance]")
    two.page.wait_for_selector("#sw-table_compliance:checked")  # what is on is not folded away
    two.page.click("#undo")
    one.page.wait_for_selector("#sw-table_compliance:not(:checked)")
    assert one.faults + two.faults == []
    one.close()
    two.close()


def test_a_program_out_of_reach_is_told(exercised, browser, tmp_path):
    tab = Tab(browser, exercised.address)
    tab.page.wait_for_selector("#sw-table_compliance", state="attached")
    (tmp_path / "far.nc").write_text("G21 G90\nG0 X0 Y0 Z5\nG1 Z0 F300\nG1 X2500\nM2\n")
    tab.page.set_input_files("#file", tmp_path / "far.nc")
    tab.page.wait_for_selector("#out-of-reach")
    assert "out of reach" in tab.text("#out-of-reach")
    tab.page.click("#undo")
    tab.until("!document.querySelector('#machine-name').textContent.includes('far.nc')")
    assert tab.faults == []
    tab.close()


WALL = "G21 G90\nT1 M6\nS8000 M3\nG0 X-20 Y-15 Z5\nG1 Z-4 F300\nY-4.5\nX120 F900\nY-15\nG0 Z5\nM2\n"
CUT = (
    "[stock]\nbox_mm = [100, 40, 20]\ncorner_mm = [0, 0, -20]\n[coefficients]\nmaterial = 'Al7075'\n"
    "[[tool]]\nnumber = 1\ndiameter_mm = 10\nflutes = 3\nhelix_deg = 30\nstick_out_mm = 30\n"
)


def test_error_width_and_compensated_path_are_layers_of_the_path(exercised, browser, tmp_path):
    tab = Tab(browser, exercised.address)
    tab.page.wait_for_selector("#sw-table_compliance", state="attached")
    for name, text in (("wall.nc", WALL), ("cut.toml", CUT)):
        (tmp_path / name).write_text(text)
        tab.page.set_input_files("#file", tmp_path / name)
    tab.page.wait_for_selector("#which-shift")
    program = exercised.idle()["program"]
    path, case = program["path"], tps.Case.open(exercised.folder)
    same = tps.compensate(case.program, case.machine_with(case.state.on), cut=case.cut)
    assert (exercised.folder / program["compensated"]["written"]).read_bytes() == same.rewritten.content
    assert max(path["shift"]) == pytest.approx(max(same.shift) * 1e6, abs=0.01)
    assert max(filter(None, path["error"])) == pytest.approx(np.nanmax(same.before.errors) * 1e6, abs=0.01)
    assert max(filter(None, path["width"])) == pytest.approx(0.5, abs=1e-3)
    for name, unit in (("error", "\u00b5m"), ("width", "mm"), ("shift", "its shift 1\u202f000 times")):
        tab.page.click(f"#which-{name}")
        assert unit in tab.text("#legend")
    tab.page.click("#undo")
    tab.page.click("#undo")
    assert tab.faults == []
    tab.close()


def test_broken_files_are_told_and_change_nothing(exercised, browser, tmp_path):
    tab = Tab(browser, exercised.address)
    tab.page.wait_for_selector("#sw-table_compliance", state="attached")
    steps = len(tps.Case.open(exercised.folder).history)
    for name, text, said in (
        ("broken<b>.csv", "x_mm,y_mm,z_mm,direction,stiffness_N_per_mm\n0,0,800,X,soft\n", "soft"),
        ("broken.toml", "name = \n", "TOML"),
        ("broken.nc", "G1 X10 F100\nG5.9 X\n", ""),
    ):
        (tmp_path / name).write_text(text)
        tab.page.set_input_files("#file", tmp_path / name)
        tab.page.wait_for_selector("#message:not([hidden])")
        tab.until(f"document.querySelector('#message').textContent.includes({json.dumps(said)})")
        tab.page.evaluate("document.querySelector('#message').hidden = true")
    exercised.idle()
    kinds = [s.kind for s in tps.Case.open(exercised.folder).history[steps:]]
    assert "data" not in kinds
    for _ in kinds:
        exercised.do(do="undo")
    assert tab.page.locator("b", has_text=".csv").count() == 0
    tab.close()


def test_axe_finds_nothing_serious(exercised, browser):
    axe = pytest.importorskip("axe_playwright_python.sync_playwright").Axe()
    tab = Tab(browser, exercised.address)
    tab.page.wait_for_selector("#sw-table_compliance", state="attached")
    serious = []
    for panel in ("effects", "why", "next", "program", "placement", "exercise", "history"):
        tab.go(panel)
        every = ((1400, "light"), (400, "dark"), (400, "light"), (1400, "dark"))
        for width, scheme in every if panel == "effects" else every[:2]:
            tab.page.set_viewport_size({"width": width, "height": 900})
            tab.page.emulate_media(color_scheme=scheme)
            serious += [
                f"{panel}, {width}, {scheme}: {one['id']}: {one['nodes'][0]['html'][:160]}"
                for one in axe.run(tab.page).response["violations"]
                if one["impact"] in ("serious", "critical")
            ]
            wide = tab.page.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth")
            assert wide <= 0, (panel, width)
    assert serious == []
    tab.close()


@pytest.fixture(scope="module")
def resumed(exercised, tmp_path_factory):
    """What a studio knew, and another on what would be left of its folder if it were killed now."""
    before = exercised.idle()
    again = Running(shutil.copytree(exercised.folder, tmp_path_factory.mktemp("killed") / "case"))
    yield before, again
    again.end()


def test_a_killed_studio_resumes_where_it_was(resumed):
    before, again = resumed
    after = again.idle()
    for name in ("history", "verdict", "gauge", "readings", "exercise"):
        assert after[name] == before[name]


PORTRAIT = {
    "text": "What is missing gives way along X, the more the higher it is loaded.",
    "links": [{"link": "frame", "probability": 0.83}, {"link": "table", "probability": 0.17}],
    "variables": [{"variable": "y", "probability": 0.72}],
    "held_out_rms_percent": 2.346,
    "noise_floor_percent": 1.987,
    "explained_percent": 61.0,
    "terms": [],
}


def of_command(folder: Path, result: str) -> dict[str, Any]:
    """The JSON document that the command has written to a result's folder."""
    return json.loads(next((folder / result).glob("*.json")).read_text())


def test_the_export_is_read_without_a_studio_and_has_the_figures_of_the_commands(resumed, browser, tmp_path):
    _, again = resumed
    state = again.idle()  # an export holds what is worked out by then
    content = again.ask("GET", "/export")[1].decode()
    assert again.token not in content
    head, mark, tail = content.partition('id="data">')
    document, end, rest = tail.partition("</script>")
    exported = json.loads(document)
    exported["verdict"]["portrait"] = PORTRAIT  # these data leave nothing to portray
    text = json.dumps(exported).replace("<", "\\u003c")
    (tmp_path / "case.html").write_text("".join([head, mark, text, end, rest]), "utf-8")
    tab = Tab(browser, (tmp_path / "case.html").as_uri())
    tab.page.wait_for_selector("#sw-table_compliance", state="attached")
    assert tab.page.locator("#undo").count() == 0
    # The gauge, the table of effects.
    said = of_command(again.folder, tps.Case.open(again.folder).latest("diagnose"))
    figures = said["baseline"]["as_given"]
    assert tab.number("#g-as_given") == pytest.approx(figures["mean_abs_error_percent"], abs=0.005)
    assert tab.number("#g-left_out") == pytest.approx(figures["held_out_error_percent"], abs=0.005)
    assert tab.number("#g-floor") == pytest.approx(said["baseline"]["noise_floor_percent"], abs=0.005)
    rows = {}
    tab.page.click("#unlikely > summary")
    for row in tab.page.locator(".effect").all():
        rows[row.locator("code").inner_text()] = " ".join(row.inner_text().split())
    for one in said["candidates"]:
        shown = rows.pop(one["effect"])
        if one["finding"]:
            errors = [one[f"{key}_error_percent"] for key in ("mean_abs", "held_out")]
            halves_up = [f"{v + 1e-9:.2f} %" for v in errors]  # 2.125 is 2.13 to the page, 2.12 to Python
            assert [text in shown for text in halves_up] == [True, True], (one["effect"], errors, shown)
        p = one["probability"]
        assert p is None or ("> 99" if p > 0.99 else "< 1" if p < 0.01 else f"{100 * p:.0f}") + " %" in shown
    shown = " ".join(tab.text("#portrait").split())
    for figure in ("83 %", "17 %", "72 %", "61 %", "2.35 %", "1.99 %"):
        assert figure in shown
    # The program.
    tab.go("program")
    kept = of_command(again.folder, state["program"]["result"])
    for name in ("mean", "min", "range"):
        assert tab.number(f"#p-{name}") == pytest.approx(kept[f"{name}_N_per_mm"], abs=0.5)
    assert tab.faults == []
    tab.close()
