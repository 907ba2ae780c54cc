"""Run the tests beside a mutant, in a copy of the project: a process each, forked from one that has imported torch."""

import multiprocessing
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from tests.mutation.mutants import ROOT, Mutant

KILLED, SURVIVED, TOO_LONG = "killed", "survived", "killed: too long"


@dataclass(frozen=True)
class Run:
    """What pytest said of a file of tests."""

    code: int | None  # its exit status, or None where it took too long
    seconds: float
    output: str

    @property
    def verdict(self) -> str:
        if self.code is None:
            return TOO_LONG
        return SURVIVED if self.code in (0, 5) else KILLED  # 5: all tests were skipped


def copy_project(folder: Path) -> None:
    """Copy what git knows or would add, so that nobody else sees a mutant; and import what all tests need."""
    listed = subprocess.check_output(["git", "ls-files", "-coz", "--exclude-standard"], cwd=ROOT, text=True)
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).exists():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, folder / name)
    os.environ |= {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1"}
    for name in ("hydra", "scipy.stats", "torchrl.envs", "torchrl.modules", "torchrl.objectives"):
        import_module(name)


def run(folder: Path, file: str, limit: float) -> Run:
    """Run a file or folder of tests of the copy, up to the first that fails, for so many seconds at most."""
    log, start = folder / "pytest.log", time.monotonic()
    process = multiprocessing.get_context("fork").Process(target=_test, args=(folder, file, log))
    process.start()
    process.join(limit)
    code = None if process.is_alive() else process.exitcode
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)  # and what its tests started
    process.kill()
    process.join()
    return Run(code, time.monotonic() - start, log.read_text(errors="replace"))


def verdict(folder: Path, mutant: Mutant, limits: dict[str, float]) -> str:
    """Run files of tests, each with its limit in seconds, with the mutant in its module's place, until one sees it."""
    path = folder / mutant.module
    sound = path.read_text()
    path.write_text(mutant.source)
    try:
        said = (run(folder, file, limit).verdict for file, limit in limits.items())
        return next((each for each in said if each != SURVIVED), SURVIVED)
    finally:
        path.write_text(sound)


def _test(folder: Path, file: str, log: Path) -> None:
    os.setsid()
    os.chdir(folder)
    sys.path[0] = str(folder)
    sys.dont_write_bytecode = True  # two mutants of one size in one second would share it
    for name in [name for name in sys.modules if name.split(".")[0] in ("tests", "warp_torchrl")]:
        del sys.modules[name]
    with log.open("w") as out:
        os.dup2(out.fileno(), 1)
        os.dup2(out.fileno(), 2)
    import pytest

    quick = ("-x", "-q", "-n", "0", "-p", "no:cacheprovider", "--no-header", "--tb=short", "--maxfail=1")
    os._exit(int(pytest.main([*quick, file])))
