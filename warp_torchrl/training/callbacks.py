"""Callbacks of a training: objects with the hooks that they want.

The progress bar, the rows of ``metrics.csv``, evaluations on the way and trackers are callbacks, as a user's are.
"""

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from typing import Protocol

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.validation import did_you_mean

HOOKS = ("on_batch", "on_evaluation", "on_checkpoint", "on_end")
"""What a callback may have:

- ``on_batch(training, row)`` after each batch; ``row`` is the row of ``metrics.csv``, float or None by column. A
  callback may add columns to it, the same ones in every row.
- ``on_evaluation(training, result)`` after each evaluation, on the way and at the end; see ``Result``.
- ``on_checkpoint(training, folder)`` after each checkpoint.
- ``on_end(training)`` when the training ends, also by an error.

``training`` is an ``OngoingTraining``.
"""


class OngoingTraining(Protocol):
    """What a callback reads of a training, and may call.

    Attributes:
        frames: World steps so far.
        last_batch: Those of the last batch.
        seconds: Since its beginning, without those between a stop and its resumption.
        run: The run folder.
        run_config: Everything that the run needs.
        callbacks: All callbacks.
    """

    frames: int
    last_batch: int
    seconds: float
    run: Path
    run_config: RunConfig
    callbacks: "Callbacks"

    @property
    def learner(self) -> Learner:
        """Return the learner: ``learner.policy`` is the policy, a ``TensorDictModule``."""
        ...

    def stop(self) -> None:
        """Let the training end after this batch, as if it had reached ``total_frames``."""
        ...


class Callbacks:
    """The callbacks of a training, called in their order.

    Args:
        callbacks: Objects with some of ``HOOKS``.

    Raises:
        ValueError: If they are no list, or one of them has no hook.
    """

    def __init__(self, callbacks: Iterable[object] = ()) -> None:
        if not isinstance(callbacks, (list, tuple)):
            raise ValueError(f"callbacks must be a list of objects, got {callbacks!r}")
        self._callbacks = tuple(callbacks)
        for each in self._callbacks:
            if isinstance(each, type) or not any(callable(getattr(each, hook, None)) for hook in HOOKS):
                near = did_you_mean(next((name for name in dir(each) if name.startswith("on_")), ""), HOOKS)
                what = f"the class {each.__name__}" if isinstance(each, type) else repr(each)
                raise ValueError(f"callbacks must be objects with some of {', '.join(HOOKS)}, got {what}{near}")

    def call(self, hook: str, *given: object) -> None:
        """Call a hook of every callback that has it."""
        for each in self._callbacks:
            if callable(called := getattr(each, hook, None)):
                called(*given)

    def end(self, training: OngoingTraining) -> None:
        """Call ``on_end`` of every callback, also where one of them fails."""
        with ExitStack() as stack:
            for each in reversed(self._callbacks):
                if callable(called := getattr(each, "on_end", None)):
                    stack.callback(called, training)
