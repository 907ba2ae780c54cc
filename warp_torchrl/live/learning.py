"""Training that a page starts from its recordings, in a separate process."""

import csv
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

import torch

from warp_torchrl.live.crew import Refused
from warp_torchrl.live.match import Setting
from warp_torchrl.live.side import Side
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.arguments import arguments_of, literal
from warp_torchrl.runs.config.construction import WORLD_KEYS
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.runs.process import STOPPED, StartedTraining, TrainingProcess

ON_POLICY = ("mappo", "ippo", "ppo", "a2c")
"""Algorithms that learn from recordings."""
MOST_FRAMES = 100_000_000
GENTLY = 0.2
"""By how much the learning rate of the policy's training is multiplied: a skilled team loses less to a new critic."""
_LEFT_TO_THE_PAGE = (
    *("start_from", "resume", "total_frames", "debug", "experiment", "imitation", "checkpoint", "evaluation"),
    *("device", "processes", "compile", "graph", "logger", "curriculum", "mixture", "plugins"),
)
_EPISODES = 64  # of the evaluation at the end
_ENDS_WITHIN = 30.0  # seconds in which a training saves


def arguments(
    policy: str, saved_config: SavedConfig, overrides: Sequence[str], recordings: Path, folder: Path, total_frames: int
) -> list[str]:
    """Return the arguments of ``train.py`` that continue the training of a policy, from recordings too.

    Args:
        policy: A shipped policy or a run folder.
        saved_config: Of its training: networks, algorithm and all else stay, except the learning rate (``GENTLY``).
        overrides: Of the scenario that is played.
        recordings: Folder of recordings.
        folder: Run folder of the new training.
        total_frames: World steps.

    Raises:
        ConfigError: If an override does not fit.
    """
    device = str(saved_config.values.get("device", "cpu"))
    values = plain(restore(saved_config, overrides))
    rate = GENTLY * float(values["algorithm"]["learning_rate"])
    return [
        *((f"plugins={literal(values['plugins'])}",) if values["plugins"] else ()),
        *_configuration(saved_config, [each for each in overrides if not each.startswith("plugins=")]),
        *((f"device={device}",) if device.startswith("cuda") and torch.cuda.is_available() else ()),
        f"algorithm.learning_rate={rate:g}",
        f"start_from={literal(policy)}",
        f"imitation.demonstrations={literal(str(recordings))}",
        f"total_frames={total_frames}",
        f"checkpoint.interval={max(1, total_frames // 10)}",
        f"evaluation.episodes={_EPISODES}",
        f"hydra.run.dir={literal(str(folder))}",
    ]


class PageTraining:
    """The training that a page started; one at a time.

    Args:
        recordings: Folder of recordings; run folders are made in its folder ``runs``.
    """

    def __init__(self, recordings: Path) -> None:
        self.recordings = recordings
        self.folder: Path | None = None
        """Run folder of the last training; None before the first."""
        self.overrides: tuple[str, ...] = ()
        """Of the scenario that it was started in."""
        self._process: StartedTraining | None = None
        self._total = 0

    @property
    def goes_on(self) -> bool:
        """Return whether a training is running."""
        return self._process is not None and self._process.poll() is None

    def start(self, side: Side, setting: Setting, total_frames: int) -> Path:
        """Train the policy of a side from the recordings, and return the run folder.

        Raises:
            Refused: If a training is running, or the policy does not learn from recordings.
            ConfigError: If an override does not fit.
        """
        found = side.player.checkpoint
        if self.goes_on:
            raise Refused(f"{self.folder} trains: stop it first")
        if found is None:
            raise Refused(f"{side.player.name} does not learn: load a trained policy in the tab Match")
        saved_config = found.saved_config()
        algorithm = saved_config.choices.get("algorithm")
        if algorithm not in ON_POLICY:
            raise Refused(
                f"{side.player.name} was trained by {algorithm}: from recordings learn {', '.join(ON_POLICY)}"
            )
        if not 1 <= total_frames <= MOST_FRAMES:
            raise Refused(f"steps must be in 1..{MOST_FRAMES}, got {total_frames}")
        folder = self.recordings / "runs" / datetime.now().strftime("%Y-%m-%d_%H-%M-%S")
        given = arguments(side.player.name, saved_config, setting.overrides, self.recordings, folder, total_frames)
        self._process = TrainingProcess(given, folder, threads=None)
        self.folder, self.overrides, self._total = folder, setting.overrides, total_frames
        return folder

    def stop(self) -> None:
        """Let the training save and end.

        Raises:
            Refused: If no training is running.
        """
        if self._process is None or not self.goes_on:
            raise Refused("no training goes on")
        self._process.stop()

    def close(self) -> None:
        """Stop a training that is running, and wait until it has saved."""
        if self._process is None or not self.goes_on:
            return
        self._process.stop()
        end = time.monotonic() + _ENDS_WITHIN
        while self.goes_on and time.monotonic() < end:
            time.sleep(0.05)

    def newest(self) -> int | None:
        """Return the frames of the newest checkpoint of the last training; None where it has none yet."""
        if self.folder is None:
            return None
        saved = [int(each.name) for each in (self.folder / "checkpoints").glob("*") if each.name.isdigit()]
        return max(saved, default=None)

    def setting(self, seed: int) -> Setting:
        """Return a setting that plays the newest policy, and loads newer weights while the training is running.

        Raises:
            Refused: If there is none yet.
        """
        if self.newest() is None or self.folder is None:
            raise Refused("no policy is trained yet")
        return Setting(policy=str(self.folder), seed=seed, overrides=self.overrides)

    def status(self) -> str:
        """Return the progress of the training, in one line; empty before the first."""
        if self._process is None or self.folder is None:
            return ""
        frames, saved = _reached(self.folder / "metrics.csv")
        so_far = f"{frames:,} of {self._total:,} steps" + ("" if saved is None else f", {saved:.0%} saved in training")
        code = self._process.poll()
        if code is None:
            return f"{self.folder} trains: {so_far}"
        if code == 0:
            return f"{self.folder} is trained: {so_far}"
        if code == STOPPED:
            resumed = checkpoints.holds_any(self.folder)
            return f"{self.folder} was stopped: {so_far}" + (
                f"; train.py resume={self.folder} goes on" if resumed else ""
            )
        return f"{self.folder} failed: {self._process.reason()}"


def _configuration(saved_config: SavedConfig, overrides: Sequence[str]) -> list[str]:
    """Return the overrides that compose a saved configuration again, without the keys that the page sets."""
    touched = {each.partition("=")[0].lstrip("+~") for each in overrides}
    if "scenario" in touched:
        touched |= set(WORLD_KEYS)
    chosen = saved_config.choices | {"collector": "direct", "curriculum": "none", "logger": "csv", "mixture": "none"}
    options = {group: option for group, option in chosen.items() if group not in touched}
    return arguments_of(saved_config, options, overrides, _LEFT_TO_THE_PAGE)


def _reached(path: Path) -> tuple[int, float | None]:
    """Return the frames of the last row of a ``metrics.csv`` that is written to its end, and the forest saved in it."""
    try:
        text = path.read_text(encoding="utf-8", errors="replace")
        row = list(csv.DictReader(text[: text.rfind("\n") + 1].splitlines()))[-1]
        return int(float(row["time/frames"])), float(row["world/saved"]) if row["world/saved"] else None
    except (OSError, LookupError, ValueError):
        return 0, None
