"""Worlds of each kind in a training, with their learners and collections."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.learner import Learner
from warp_torchrl.collection.collectors import InProcess
from warp_torchrl.collection.running import Collection
from warp_torchrl.env import WildfireEnv
from warp_torchrl.models import joint, signature
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.worlds import KindOfWorld
from warp_torchrl.training.reward_scale import RewardScale


@dataclass(frozen=True, kw_only=True)
class TaskWorlds:
    """The worlds of one kind that this process plays.

    Attributes:
        kind: Rules of the worlds.
        env: The worlds.
        first_seed: Seed of the first world.
        weight: Their share of this process's worlds.
    """

    kind: KindOfWorld
    env: WildfireEnv
    first_seed: int
    weight: float


def task_worlds(run_config: RunConfig) -> list[TaskWorlds]:
    """Return this process's worlds of each kind, with consecutive seeds."""
    worlds = run_config.n_worlds // parallel.size()
    seed, found = run_config.first_seed + worlds * parallel.rank(), []
    for kind, count in zip(run_config.kinds, run_config.worlds_of_kinds(worlds), strict=True):
        env = run_config.make_training_env(count, seed, kind.world)
        found.append(TaskWorlds(kind=kind, env=env, first_seed=seed, weight=count / worlds))
        seed += count
    return found


def learners(run_config: RunConfig, worlds: Sequence[TaskWorlds]) -> list[Learner]:
    """Return a learner for each kind of worlds; all have the same networks, loss and optimiser."""
    frames = [run_config.collector.steps * each.env.batch_size[0] for each in worlds]
    first, model = worlds[0], run_config.model
    if len(worlds) == 1:
        return [run_config.algorithm.build(first.env, model, frames[0])]
    shape = joint([signature(each.env) for each in worlds])
    made = run_config.algorithm.build(first.env, model, frames[0], shape, first.weight)
    further = zip(worlds[1:], frames[1:], strict=True)
    return [
        made,
        *(run_config.algorithm.beside(made, its.env, model, count, shape, its.weight) for its, count in further),
    ]


class Task:
    """One kind of worlds that this process collects and learns from.

    Args:
        worlds: The worlds.
        learner: Learner of these worlds.
        collector: Configuration of the collection.
        run_config: Configuration of the training.
    """

    def __init__(self, worlds: TaskWorlds, learner: Learner, collector: InProcess, run_config: RunConfig) -> None:
        self.name, self.env, self.weight, self.learner = worlds.kind.name, worlds.env, worlds.weight, learner
        self.reward_scale = RewardScale(run_config.reward.gamma) if run_config.reward.normalise else None
        self.collection: Collection = collector.open(
            worlds.env, learner, run_config.make_training_env, worlds.first_seed
        )

    def state_dict(self) -> dict[str, Any]:
        """Return the state that an exact resume needs."""
        return {
            "keeps": {name: each.state_dict() for name, each in self.learner.keeps.items()},
            "collection": self.collection.state_dict(),
            "reward_scale": {} if self.reward_scale is None else self.reward_scale.state_dict(),
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restore what ``state_dict`` returned."""
        for name, each in self.learner.keeps.items():
            each.load_state_dict(state["keeps"][name])
        self.collection.load_state_dict(state["collection"])
        if self.reward_scale is not None:
            self.reward_scale.load_state_dict(state["reward_scale"])
