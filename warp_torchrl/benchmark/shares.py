"""Shares of the training loop's time."""

from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import torch
from tensordict import TensorDictBase

from warp_torchrl.benchmark.tables import entry, table
from warp_torchrl.benchmark.timing import Timer, clock
from warp_torchrl.training.loop import Training

_PARTS = ("collector", "environment", "policy", "advantages", "sampling", "loss", "backward", "optimiser", "other")
_COLLECTING = ("collector", "environment", "policy")


class Stopwatch:
    """Sums the time of each part of a program [s].

    Args:
        now: Returns the time [s].
    """

    def __init__(self, now: Timer) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._now, self._last = now, now()

    def lap(self, part: str) -> None:
        """Add the time since the last lap to a part."""
        now = self._now()
        self.seconds[part] += now - self._last
        self._last = now


def training_shares(training: Training, batches: Iterator[list[TensorDictBase]], count: int) -> list[dict[str, Any]]:
    """Measure the shares of parts of the training loop in the time of some batches.

    Args:
        training: The run; it learns from the batches.
        batches: Batches of the run, one of each kind of worlds at a time.
        count: Batches to measure.

    Returns:
        A row for each part, with ``seconds`` per batch and its ``share``. The collector's share excludes the
        environment and the policy; backward ends before the gradients are clipped, which belongs to the optimiser.
    """
    with _watched(training, clock(training.env.device.type)) as watch:
        for _ in range(count):
            found = next(batches)
            watch.lap("collector")
            training._learn(found)
            training.go_on()
            watch.lap("other")
    total = sum(watch.seconds.values())
    collecting = sum(watch.seconds[part] for part in _COLLECTING)
    seconds = {"collecting": collecting} | {part: watch.seconds[part] for part in _PARTS}
    return [
        {
            "part": part,
            "of": "collecting" if part in _COLLECTING else None,
            "seconds": each / count,
            "share": each / total,
        }
        for part, each in seconds.items()
    ]


def share_table(rows: list[dict[str, Any]]) -> str:
    """Return the shares as a table for the terminal."""
    columns = [
        ("part of the training loop", lambda row: f"  {row['part']}" if row["of"] else row["part"]),
        entry("scenario"),
        entry("ms a batch", "milliseconds", "{:,.1f}"),
        entry("share", "share", "{:.1%}"),
    ]
    return table(columns, [row | {"milliseconds": 1000.0 * row["seconds"]} for row in rows])


@contextmanager
def _watched(training: Training, now: Timer) -> Iterator[Stopwatch]:
    """Let a stopwatch run over a training's parts, until the context ends."""
    watch, learner = Stopwatch(now), training.learner
    samples = learner.samples

    def timed_samples() -> Iterator[TensorDictBase]:
        left = iter(samples())
        while True:
            watch.lap("other")
            sample = next(left, None)
            watch.lap("sampling")
            if sample is None:
                return
            yield sample

    with ExitStack() as stack:
        for owner, name, before, after in (
            (training.env, "step_and_maybe_reset", "collector", "environment"),
            (learner.explore, "forward", "collector", "policy"),
            (learner, "store", "other", "advantages"),
            (learner, "terms", "other", "loss"),
            (torch.nn.utils, "clip_grad_norm_", "backward", "optimiser"),
            (learner.optimizer, "step", "optimiser", "optimiser"),
        ):
            stack.enter_context(_replaced(owner, name, _timed(watch, getattr(owner, name), before, after)))
        stack.enter_context(_replaced(learner, "samples", timed_samples))
        yield watch


def _timed(watch: Stopwatch, call: Callable[..., Any], before: str, after: str) -> Callable[..., Any]:
    """Return a function whose time counts as ``after``, and the time before the call as ``before``."""

    def timed(*args: Any, **kwargs: Any) -> Any:
        watch.lap(before)
        found = call(*args, **kwargs)
        watch.lap(after)
        return found

    return timed


@contextmanager
def _replaced(owner: Any, name: str, other: Any) -> Iterator[None]:
    """Replace an attribute until the context ends."""
    own = vars(owner).get(name)
    setattr(owner, name, other)
    try:
        yield
    finally:
        if own is None:
            delattr(owner, name)
        else:
            setattr(owner, name, own)
