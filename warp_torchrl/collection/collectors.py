"""Collectors of TorchRL: in this process, in several, or on a Ray cluster."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, ClassVar

import torch
from torchrl.collectors import BaseCollector, Collector

from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.running import Collection, InProcessCollection, MultiProcessCollection
from warp_torchrl.env import WildfireEnv
from warp_torchrl.system.parent import bind_workers, end_with
from warp_torchrl.validation import check_fields

MakeEnv = Callable[[int, int], WildfireEnv]
"""Called with a number of worlds and the seed of the first."""


_UNLIMITED = 10**12  # batches; TorchRL's Ray collector takes no -1


@dataclass(frozen=True, kw_only=True)
class InProcess:
    """Collects in this process. A resumed run is exact.

    Batches that grow learn fast at first and well in the end: many small updates from young networks, few precise ones
    from skilled networks. Off-policy learners and recurrent actors have batches of one size.

    Attributes:
        steps: Steps of each world in a batch.
        first_steps: Steps of each world in the first batches, if they grow; None: half of ``steps`` if that is whole.
        grows_at: Share of the training after which batches have all ``steps``; 0 gives them those from the start.

    Raises:
        ValueError: If a value is out of its range, or first_steps does not divide more steps.
    """

    steps: int = 32
    first_steps: int | None = None
    grows_at: float = 0.25

    def __post_init__(self) -> None:
        self.check()

    def check(self, **ranges: tuple[float, float]) -> None:
        """Check the numbers against their ranges, and further fields against ``ranges``."""
        count = (1, 100_000)
        check_fields(self, steps=count, first_steps=count, grows_at=(0.0, 1.0), **ranges)
        if self.steps % self.segment:
            raise ValueError(f"first_steps must divide steps, {self.steps}, got {self.first_steps}")

    @property
    def segment(self) -> int:
        """Return the steps of each world between two looks at the collector; a batch has one or several segments."""
        if not self.grows_at:
            return self.steps
        half = self.steps if self.steps % 2 else self.steps // 2
        return half if self.first_steps is None else min(self.steps, self.first_steps)

    def segments(self, progress: float) -> int:
        """Return how many segments a batch has at progress in 0..1."""
        return 1 if progress < self.grows_at else self.steps // self.segment

    def end(self, total: int, n_worlds: int) -> int:
        """Return the frames after which a training of at least ``total`` frames ends, in whole batches."""
        small, large = n_worlds * self.segment, n_worlds * self.steps
        grown = small * -(-int(self.grows_at * total) // small)
        if grown >= total:
            return small * -(-total // small)
        return grown + large * -(-(total - grown) // large)

    def check_worlds(self, n_worlds: int) -> None:
        """Accept any number of worlds."""

    def open(self, env: WildfireEnv, learner: Learner, make_env: MakeEnv, seed: int) -> Collection:
        """Return a collection in ``env`` with the learner's policy; it resets finished worlds at once."""
        return InProcessCollection(env, learner, self.segment)


@dataclass(frozen=True, kw_only=True)
class MultiProcess(InProcess):
    """Collects in worker processes, each with an equal share of the worlds; they wait while the learner learns.

    World i has the same seed as in-process. A resumed run continues with new episodes.

    Attributes:
        workers: Number of processes.

    Raises:
        ValueError: If a value is out of its range.
    """

    workers: int = 2
    starts_processes: ClassVar[bool] = True
    """Whether the workers are processes that this one starts, and which end with it."""

    def __post_init__(self) -> None:
        self.check(workers=(1, 1024))

    def check_worlds(self, n_worlds: int) -> None:
        """Check that the workers can share the worlds equally.

        Raises:
            ValueError: If they cannot.
        """
        if n_worlds % self.workers:
            raise ValueError(f"workers must divide n_worlds, {n_worlds}, got {self.workers}")

    def open(self, env: WildfireEnv, learner: Learner, make_env: MakeEnv, seed: int) -> Collection:
        """Return a collection in workers, with as many worlds as ``env`` and the learner's policy."""
        share = env.batch_size[0] // self.workers
        starts = [seed + worker * share for worker in range(self.workers)]
        frames = self.segment * env.batch_size[0]

        def start(first_episode: int) -> BaseCollector:
            parent = None
            if self.starts_processes:
                parent = os.getpid()
                bind_workers()
            makers = [partial(_worlds, make_env, share, each, first_episode, parent) for each in starts]
            return Collector(
                makers,
                learner.explore,
                num_collectors=self.workers,
                sync=True,
                frames_per_batch=frames,
                total_frames=frames * _UNLIMITED,
                **self.backend(),
            )

        return MultiProcessCollection(start, self.segment, env.device)

    def backend(self) -> dict[str, Any]:
        """Return the backend and its options for TorchRL's collector."""
        return {"backend": "process", "backend_options": {"auto_register_policy_transforms": False}}


@dataclass(frozen=True, kw_only=True)
class Ray(MultiProcess):
    """Collects in workers of a Ray cluster; otherwise as ``MultiProcess``. Needs the extra ``ray``.

    Attributes:
        address: Address of the cluster; ``auto`` takes the cluster of this machine, None starts a local one.
        cpus: CPUs that Ray reserves for a worker.
        gpus: GPUs, or a share of one, for a worker; its worlds live there where ``device`` is cuda.

    Raises:
        ValueError: If a value is out of its range, or Ray is not installed.
    """

    address: str | None = None
    cpus: float = 1.0
    gpus: float = 0.0
    starts_processes: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self.check(workers=(1, 1024), cpus=(0.0, 1e4), gpus=(0.0, 64.0))
        try:
            import ray  # noqa: F401
        except ImportError:
            raise ValueError('workers need Ray: pip install "warp_torchrl[ray]"') from None

    def backend(self) -> dict[str, Any]:
        """Return the backend and its options for TorchRL's collector."""
        here = {"_node_ip_address": "127.0.0.1"} if self.address is None else {}  # a Ray of its own listens here alone
        options = {
            "ray_init_config": {"address": self.address, "log_to_driver": False, **here},
            "remote_configs": {"num_cpus": self.cpus, "num_gpus": self.gpus},
            "collector_kwargs": {"auto_register_policy_transforms": False},
        }
        return {"backend": "ray", "backend_options": options}


def _worlds(make_env: MakeEnv, count: int, seed: int, first_episode: int, parent: int | None) -> WildfireEnv:
    """Return a worker's environment, and seed the worker's generator for sampled actions.

    A worker would otherwise continue its batch after its parent has ended, so it watches the parent.
    """
    if parent is not None:
        end_with(parent)
    torch.manual_seed((seed + 2**40 * first_episode) % 2**64)
    env = make_env(count, seed)
    env.set_seeds(range(seed, seed + count), first_episode)
    return env
