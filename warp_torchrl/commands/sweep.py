"""Sweeps: list the jobs of a command line, keep their failures, and summarise the results."""

import json
import os
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, ClassVar

from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from warp_torchrl.evaluation import summary
from warp_torchrl.evaluation.rows import SummaryRow, read_rows
from warp_torchrl.runs.config.construction import ConfigError, construct
from warp_torchrl.system import disk
from warp_torchrl.system.foreign import read_json
from warp_torchrl.system.parent import SECONDS_TO_SAVE, bind_workers, end_with

FAILURE = "failed.json"
_JOBLIB = "hydra_joblib_launcher"
_LARGEST = 1_000_000  # bytes


@dataclass(frozen=True, kw_only=True)
class Failure:
    """A job of a sweep that failed.

    Attributes:
        job: Number of the job.
        overrides: The job's overrides.
        code: Exit code of the failure.
        reason: The error in one line.
    """

    job: int
    overrides: str
    code: int
    reason: str


def jobs(overrides: Sequence[str]) -> list[list[str]]:
    """Return the overrides of each job of a sweep.

    Raises:
        ConfigError: If Hydra cannot parse an override.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(list(overrides))
    except Exception as error:
        raise ConfigError(" ".join(str(error).split())) from None
    choices = [
        [f"{each.get_key_element()}={value}" for value in each.sweep_string_iterator()]
        if each.is_sweep_override()
        else [str(each.input_line)]
        for each in parsed
    ]
    return [list(job) for job in product(*choices)]


def remove_failure() -> None:
    """Remove the failure that an earlier sweep into the same folder left for this job."""
    Path(HydraConfig.get().runtime.output_dir, FAILURE).unlink(missing_ok=True)


def save_failure(code: int, reason: str) -> None:
    """Write a failed job's error into its folder: another process may run the end of the sweep."""
    job = HydraConfig.get().job
    failure = Failure(job=int(job.num), overrides=" ".join(HydraConfig.get().overrides.task), code=code, reason=reason)
    folder = Path(HydraConfig.get().runtime.output_dir)
    folder.mkdir(parents=True, exist_ok=True)
    disk.replace(folder / FAILURE, json.dumps(asdict(failure)))


def failures(folder: Path) -> list[Failure]:
    """Return the failed jobs in a sweep's folder, in order of their numbers."""
    found = [_read(path) for path in folder.glob(f"**/{FAILURE}")]
    return sorted(found, key=lambda each: each.job)


def _read(path: Path) -> Failure:
    """Return the failure in a job's folder.

    Raises:
        ConfigError: If it is none.
    """
    try:
        failure: Failure = construct(Failure, read_json(path, _LARGEST), "")
    except ValueError as error:
        raise ConfigError(f"{path} is not what a failed job writes: {error}") from None
    return failure


class SweepSummary(Callback):
    """Ends a sweep with a table and a figure of all its evaluations, and a line for each failed job.

    Attributes:
        exit_code: Exit code of the first failed job; 0 if none failed.
        folder: Folder of the running sweep.
    """

    exit_code: ClassVar[int] = 0
    folder: ClassVar[Path | None] = None

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Keep the sweep's folder: a launcher that stops early never calls ``on_multirun_end``."""
        SweepSummary.folder = Path(str(config.hydra.sweep.dir))
        if _JOBLIB in str(config.hydra.launcher._target_):
            _let_workers_end_with_us()

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Write ``summary.md`` and ``summary.png`` into the sweep's folder, and print the table."""
        failed = _write_summary(Path(str(config.hydra.sweep.dir)))
        SweepSummary.exit_code = failed[0].code if failed else 0
        SweepSummary.folder = None


def _let_workers_end_with_us() -> None:
    """Let joblib's workers watch this process: otherwise they work on, and then wait for minutes for more."""
    from joblib import register_parallel_backend
    from joblib._parallel_backends import LokyBackend

    bind_workers(SECONDS_TO_SAVE)
    watch = {"initializer": end_with, "initargs": (os.getpid(), SECONDS_TO_SAVE)}  # where it has ended before
    register_parallel_backend("loky", partial(LokyBackend, **watch))


def summarise_unfinished() -> None:
    """Summarise a sweep whose launcher stopped early, as joblib's and submitit's do when a worker is killed."""
    folder, SweepSummary.folder = SweepSummary.folder, None
    if folder is None or not folder.is_dir():
        return
    _write_summary(folder)
    for log in sorted(folder.glob("**/*.log")):
        if not ((log.parent / "evaluation.json").exists() or (log.parent / FAILURE).exists()):
            print(f"error: the job in {log.parent} did not end", file=sys.stderr, flush=True)


def _write_summary(folder: Path) -> list[Failure]:
    entries = read_rows(folder)
    if entries:
        _summarise(entries, folder)
    failed = failures(folder)
    for each in failed:
        print(f"error: job {each.job} ({each.overrides}) failed: {each.reason}", file=sys.stderr, flush=True)
    return failed


def _summarise(entries: list[SummaryRow], folder: Path) -> None:
    text = summary.summary_table(entries)
    disk.replace(folder / "summary.md", text + "\n")
    print(text, flush=True)
    try:
        summary.draw_summary(entries, folder / "summary.png")
    except ImportError:
        print('no summary.png: Matplotlib is missing, pip install "warp_torchrl[figures]"', flush=True)
    print(f"wrote the summary into {folder}", flush=True)
