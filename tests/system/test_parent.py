"""A process ends with the one that started it: in its imports, in the middle of its work, and when it has to save."""

import importlib.util
import os
import signal
import subprocess
import sys
import time

import pytest

from tests.stress.processes import alive
from warp_torchrl.system.parent import bind_workers, end_with_binder, is_orphaned

PARENT = importlib.util.find_spec("warp_torchrl.system.parent").origin
STARTER = f"""
import os, runpy, subprocess, sys, time
command = runpy.run_path({PARENT!r})["command"]
subprocess.Popen(command(sys.argv[1], [], float(sys.argv[2])))
time.sleep(600)
"""
WORK = {
    "works": "while True:\n    pass\n",
    "waits": "import time\ntime.sleep(600)\n",
    "saves": "import pathlib, signal, time\n"
    "signal.signal(signal.SIGTERM, lambda *given: (pathlib.Path('saved').touch(), exit()))\n"
    "time.sleep(600)\n",
    "hangs": "import signal, time\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\ntime.sleep(600)\n",
}


def wait_for(what, seconds=10.0):
    deadline = time.monotonic() + seconds
    while not what() and time.monotonic() < deadline:
        time.sleep(0.01)
    return what()


@pytest.mark.parametrize(("work", "seconds"), [("works", 0), ("waits", 0), ("saves", 60), ("hangs", 1)])
def test_a_process_ends_with_the_one_that_started_it(tmp_path, work, seconds):
    (tmp_path / "job.py").write_text(f"import pathlib\npathlib.Path('begun').touch()\n{WORK[work]}")
    command = [sys.executable, "-c", STARTER, "job", str(seconds)]
    starter = subprocess.Popen(command, cwd=tmp_path, env={"PYTHONPATH": str(tmp_path)}, start_new_session=True)
    assert wait_for((tmp_path / "begun").exists)
    assert len(alive(starter.pid)) == 2
    starter.kill()
    starter.wait()
    assert wait_for(lambda: not alive(starter.pid), 5.0)
    assert (tmp_path / "saved").exists() == (work == "saves")


def test_a_process_whose_parent_has_ended_does_not_begin(tmp_path):
    (tmp_path / "job.py").write_text("import pathlib\npathlib.Path('begun').touch()\n")
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    command = [sys.executable, "-P", PARENT, str(gone.pid), "0", "job"]
    done = subprocess.run(command, cwd=tmp_path, env={"PYTHONPATH": str(tmp_path)})
    assert done.returncode == 128 + signal.SIGTERM and not (tmp_path / "begun").exists()


IMPORTS = f"""
import os, runpy, subprocess, sys
parent = runpy.run_path({PARENT!r})
if sys.argv[1:] == ["begin"]:
    parent["bind_workers"]()
    subprocess.Popen([sys.executable, __file__, "worker"])
    os.kill(os.getpid(), 9) if os.environ.get("AT_ONCE") else __import__("time").sleep(600)
if os.environ.get("AT_ONCE"):
    __import__("time").sleep(0.5)  # until its parent has ended
parent["end_with_binder"]()
open("begun", "w").close()
__import__("time").sleep(600)
"""


@pytest.mark.parametrize("at_once", ["", "yes"])
def test_a_worker_that_a_library_starts_ends_with_its_parent_even_if_that_has_ended_before(tmp_path, at_once):
    (tmp_path / "job.py").write_text(IMPORTS)
    command = [sys.executable, "job.py", "begin"]
    starter = subprocess.Popen(command, cwd=tmp_path, env={"AT_ONCE": at_once}, start_new_session=True)
    if not at_once:
        assert wait_for((tmp_path / "begun").exists)
        starter.kill()
    starter.wait()
    assert wait_for(lambda: not alive(starter.pid), 5.0)
    assert (tmp_path / "begun").exists() == (not at_once)


def test_other_processes_that_inherit_the_environment_go_on(monkeypatch):
    monkeypatch.setenv("WARP_TORCHRL_PARENT", "")  # so that it is taken back
    bind_workers()
    end_with_binder()
    assert not is_orphaned()


def test_the_first_process_obeys_signals_for_those_that_have_nothing_to_save(tmp_path):
    (tmp_path / "job.py").write_text(
        "import os, signal, sys\nos.kill(os.getpid(), signal.SIGINT)\nos.kill(os.getpid(), signal.SIGHUP)\n"
    )
    command = [sys.executable, "-P", PARENT, str(os.getpid()), "0", "job"]
    assert subprocess.run(command, cwd=tmp_path, env={"PYTHONPATH": str(tmp_path)}).returncode == 0
