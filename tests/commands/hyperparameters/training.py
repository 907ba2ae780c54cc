"""Trainings that take no time: each look at one is a tenth of it."""

import json
from pathlib import Path

from warp_torchrl.runs.process import STOPPED

TOTAL = 1000


class Quick:
    """A training whose forest saved rises to a value, and which goes on from where its folder's rows end.

    Args:
        saved: What it saves in the end.
        folder: Its run folder.
        code: Exit code at ``until``.
        until: The tenth after which it ends.
    """

    def __init__(self, saved: float, folder: Path, code: int = 0, until: int = 10) -> None:
        self.saved, self.folder, self.code, self.until = saved, folder, code, until
        self.is_stopped = False
        self.metrics = folder / "metrics.csv"
        if not self.metrics.exists():
            folder.mkdir(parents=True, exist_ok=True)
            self.metrics.write_text("time/frames,world/saved\n")

    @property
    def done(self) -> int:
        return len(self.metrics.read_text().splitlines()) - 1

    def poll(self) -> int | None:
        if self.is_stopped:
            return STOPPED
        if self.done >= self.until:
            if self.code == 0:
                content = {"metrics": {"saved": {"mean": self.saved + 0.01}}}
                (self.folder / "evaluation.json").write_text(json.dumps(content))
            return self.code
        with self.metrics.open("a") as file:
            file.write(f"{(self.done + 1) * TOTAL // 10},{self.saved * (self.done + 1) / 10}\n")
        return None

    def stop(self) -> None:
        self.is_stopped = True

    def reason(self) -> str:
        return f"ended with {self.code}"
