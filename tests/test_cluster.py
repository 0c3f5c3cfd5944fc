"""Programs on a real Dask scheduler with two worker processes: the same bytes, failures, workers that die."""

from __future__ import annotations

import json
import sys
from importlib.util import find_spec
from time import monotonic, sleep

import pytest

import toolpath_stiff as tps
from tests.test_cli_analyze import PART, _nist
from tests.test_cli_batch import BROKEN, QUICK, files_of, rows_of
from toolpath_stiff.cli.main import main

# Loaded by the tests that need it, as collecting is done by every process.
pytestmark = pytest.mark.skipif(find_spec("distributed") is None, reason="distributed is not installed")

# Kills the process that sees the tool at Z 850 mm, but never the one that runs the tests.
DEADLY = '''
import os
from multiprocessing import parent_process
import numpy as np
from toolpath_stiff.stiffness.effects import Effect, Parameter


class Deadly(Effect):
    """Kills the worker that computes with it."""

    name, title, link, equation, source = "deadly", "deadly", "struts", "-", "-"
    parameters = (Parameter("size", "", 1.0, (0.0, 1e9), (0.0, 1.0), "-"),)

    def strut_compliance(self, path, p):
        if parent_process() is not None and (path.position[:, 2] > 0.84).any():
            os._exit(9)
        return np.zeros((len(path), 6))
'''


@pytest.fixture(scope="module")
def cluster():
    import multiprocessing

    import dask
    import distributed

    # Workers begin with the libraries loaded, as two start and three more are started where others died.
    multiprocessing.set_forkserver_preload(
        ["distributed", "pandas", "toolpath_stiff.api.many", "toolpath_stiff.report"]
    )
    settings = {
        "distributed.scheduler.allowed-failures": 1,  # one try more: each death costs the start of a new worker
        "distributed.comm.timeouts.connect": "60s",
        "distributed.worker.multiprocessing-method": "forkserver",
    }
    with (
        dask.config.set(settings),
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None, silence_logs=50
        ) as found,
    ):
        yield found


@pytest.fixture
def shop(tmp_path, monkeypatch):
    """As of the tests of `tps analyze` of a folder; not where the workers were started."""
    monkeypatch.chdir(tmp_path)
    texts = {"a/part.nc": PART, "bad.nc": BROKEN, "b/part.nc": PART.replace("Z0", "Z50")}
    for name, text in texts.items():
        path = tmp_path / "jobs" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return tmp_path


def test_a_cluster_gives_the_same_bytes_and_the_same_words(cluster, shop, capsys):
    """One program fails; machine, effects and programs are named by relative paths."""
    (shop / "soft.toml").write_text(_nist().replace("bar_stiffness_N_per_m = inf", "bar_stiffness_N_per_m = 3e8"))
    arguments = ["analyze", "jobs", "jobs/gone.nc", "--step", "20", "--machine", "soft.toml", "--compare", "nist"]
    printed = []
    for out, how in (("one", ["--jobs", "1"]), ("two", ["--cluster", cluster.scheduler_address])):
        assert main([*arguments, "--out", out, *how]) == 1
        printed.append(capsys.readouterr().out.replace(f"{out}/", "/"))
    assert printed[0] == printed[1] and "2 of 4 programs failed:" in printed[0]
    assert "cannot read 'jobs/gone.nc'" in printed[0] and "jobs/bad.nc:3:1: " in printed[0]
    assert files_of(shop / "one") == files_of(shop / "two")
    assert "a/part/report.html" in files_of(shop / "two")


def test_the_function_takes_the_executor_of_a_client(cluster, shop):
    from distributed import Client

    with Client(cluster, set_as_default=False) as client:
        done = tps.analyze_many(["jobs"], "nist", "o", executor=client.get_executor(), plots=False, step_mm=20)
        again = tps.analyze_many(["jobs"], "nist", "o", executor=client.get_executor(), plots=False, step_mm=20)
    assert [one.status for one in done.outcomes] == ["done", "done", "failed"]
    assert done.outcomes == again.outcomes
    assert done.to_json() == json.dumps(done.to_dict(), indent=2) + "\n"


def test_a_worker_that_dies_fails_its_own_program_alone(cluster, shop):
    """The last test on the cluster: on a busy machine Dask may not bring its workers back."""
    (shop / "deadly.py").write_text(DEADLY)
    (shop / "deadly.toml").write_text(_nist() + '\n[[effect]]\nname = "deadly"\nsize = 1.0\n')
    machine = ["--machine", "deadly.toml", "--effects", "deadly.py", "--allow-unchecked-effects"]
    assert main(["analyze", "jobs", "--cluster", cluster.scheduler_address, "--out", "o", *machine, *QUICK]) == 1
    rows = rows_of(shop / "o")
    assert {file: row["status"] for file, row in rows.items()} == {
        "jobs/a/part.nc": "done", "jobs/b/part.nc": "failed", "jobs/bad.nc": "failed",
    }  # fmt: skip
    reason = rows["jobs/b/part.nc"]["reason"]
    assert reason.startswith("jobs/b/part.nc: no process could do it: KilledWorker: ")
    assert "on 2 different workers, but all those workers died" in reason and "tcp://127.0.0.1:" in reason
    assert rows["jobs/bad.nc"]["reason"].startswith("jobs/bad.nc:3:1: ")
    # Dask may still be computing again a result that was lost with the worker; such a run takes its folder away itself.
    until = monotonic() + 60.0
    while left := [path for path in (shop / "o").rglob(".tps-*") if path.is_dir()]:
        assert monotonic() < until, left
        sleep(0.1)


def test_a_scheduler_that_does_not_answer_is_one_message(shop, capsys, monkeypatch):
    monkeypatch.setattr("toolpath_stiff.cli.program.CONNECT_SECONDS", 0.5)
    for address in ("tcp://127.0.0.1:1", "127.0.0.1:1", "nowhere://x", "tcp://"):
        assert main(["analyze", "jobs", "--cluster", address, *QUICK]) == 2
        captured = capsys.readouterr()
        assert captured.err.startswith(f"tps: error: --cluster {address}: ") and captured.out == ""
        assert "expected the address of a Dask scheduler" in captured.err and captured.err.count("\n") == 1
    assert not (shop / "reports").exists()


def test_without_the_package_the_extra_is_named(shop, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert main(["analyze", "jobs/a/part.nc", "--cluster", "tcp://127.0.0.1:8786"]) == 2
    assert "pip install 'toolpath-stiff[cluster]'" in capsys.readouterr().err


def test_jobs_are_not_for_a_cluster(shop, capsys):
    assert main(["analyze", "jobs", "--cluster", "tcp://127.0.0.1:8786", "--jobs", "2"]) == 2
    assert "--cluster with --jobs; expected one of the two" in capsys.readouterr().err
