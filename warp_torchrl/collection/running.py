"""Running collections: batches without end, and their state in a checkpoint."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Protocol

import torch
from tensordict import TensorDict, TensorDictBase
from torchrl.collectors import BaseCollector, Collector

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.algorithms.parallel import WorkerDied
from warp_torchrl.env import WildfireEnv


class Collection(Protocol):
    """A running collection."""

    def __iter__(self) -> Iterator[TensorDictBase]:
        """Yield batches [B, T] without end."""
        ...

    def refresh(self) -> None:
        """Give the workers the learner's current weights."""
        ...

    def state_dict(self) -> dict[str, Any]:
        """Return the state for a checkpoint."""
        ...

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore what ``state_dict`` returned."""
        ...

    def start_anew(self, steps: int) -> None:
        """Start a new episode in every world, with a number that no episode of ``steps`` steps has had."""
        ...

    def close(self) -> None:
        """Shut the collector down."""
        ...


class InProcessCollection:
    """A collector in this process."""

    def __init__(self, env: WildfireEnv, learner: Learner, steps: int) -> None:
        self.env = env
        self._collector = Collector(
            env,
            learner.explore,
            frames_per_batch=steps * env.batch_size[0],
            total_frames=-1,
            return_same_td=True,
            track_traj_ids=False,
            auto_register_policy_transforms=False,
        )

    def __iter__(self) -> Iterator[TensorDictBase]:
        return iter(self._collector)

    def refresh(self) -> None:
        """Do nothing: the collector shares the learner's policy."""

    def state_dict(self) -> dict[str, Any]:
        """Return the environment's state and the tensordict that the collector carries over to its next batch."""
        carrier = self._collector._carrier.flatten_keys(".")
        return {"env": self.env.state_dict(), "carrier": {name: value.clone() for name, value in carrier.items()}}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore what ``state_dict`` returned: the next batch is as if the run had never stopped."""
        self.env.load_state_dict(state["env"])
        here = self._collector._carrier.flatten_keys(".")
        other = [
            f"{name} {list(value.shape)}"
            for name, value in state["carrier"].items()
            if name in here.keys() and here[name].shape != value.shape
        ]
        if other:
            raise ValueError(f"the worlds must have the entries that the run had, and lack {', '.join(other)}")
        carrier = TensorDict(state["carrier"], batch_size=self.env.batch_size).unflatten_keys(".")
        shaped = self._collector._carrier.empty(recurse=True)  # keeps the batch sizes of nested tensordicts
        self._collector._carrier = shaped.update(carrier.to(self.env.device))

    def start_anew(self, steps: int) -> None:
        """Start a new episode in every world: a world has had at most one episode per step."""
        self.env.set_seeds(self.env.seeds.tolist(), steps)
        self._collector.reset()

    def close(self) -> None:
        """Shut the collector down."""
        self._collector.shutdown()


class MultiProcessCollection:
    """A collector with workers, which start with the first batch."""

    def __init__(self, start: Callable[[int], BaseCollector], steps: int, device: torch.device) -> None:
        self._start, self._steps, self._device = start, steps, device
        self._collector: BaseCollector | None = None
        self._played = 0  # steps of each world

    def __iter__(self) -> Iterator[TensorDictBase]:
        try:
            # A world has had at most as many episodes as steps, so episodes from this number on are new.
            self._collector = self._start(self._played)
            for batch in self._collector:
                self._played += self._steps
                yield batch.exclude("collector").flatten(0, -2).to(self._device)  # [workers, B / workers, T]
        except Exception as error:  # each backend raises its own types
            what = "the collector's workers did not start" if self._collector is None else "a worker has ended"
            raise WorkerDied(f"{what}: {_reason(self._collector, error)}") from error

    def refresh(self) -> None:
        """Send the learner's weights to the workers."""
        if self._collector is not None:
            self._collector.update_policy_weights_()

    def state_dict(self) -> dict[str, Any]:
        """Return the number of steps of each world."""
        return {"played": self._played}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore the number of steps; the next episodes are new ones."""
        self._played = int(state["played"])

    def start_anew(self, steps: int) -> None:
        """Set the number of steps: new workers play new episodes."""
        self._played = steps

    def close(self) -> None:
        """Shut the workers down."""
        if self._collector is not None:
            self._collector.shutdown()


def _reason(collector: BaseCollector | None, error: Exception) -> str:
    """Return one line that names the worker that ended and its exit, if the backend knows it."""
    ended = []
    for index, process in enumerate(getattr(collector, "procs", ())):
        try:
            code = process.exitcode
        except ValueError:
            code = None
        if code:
            ended.append(f"worker {index} by {'signal ' if code < 0 else 'exit code '}{abs(code)}")
    return ", ".join(ended) or next(iter(str(error).splitlines()), type(error).__name__)
