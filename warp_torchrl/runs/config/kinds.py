"""The kinds of worlds of a training, built."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Observation
from warp_torchrl.env.reward import Reward
from warp_torchrl.models import differing, signature
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class KindOfWorld:
    """A kind of worlds, built.

    Attributes:
        name: Name of the kind.
        world: Its rules.
        share: Share of the worlds, in proportion to the shares of the others.
        teacher: Teacher of its worlds; None for none.
        teacher_weight: Factor on the weight of the cloning loss.
    """

    name: str
    world: World
    share: float = 1.0
    teacher: str | None = None
    teacher_weight: float = 1.0


def check_kinds(kinds: Sequence[KindOfWorld], observation: Observation, reward: Reward) -> None:
    """Check that one team can play all kinds of a mixture, and the reward can be computed in each.

    Raises:
        ConfigError: If observations, states, actions, roles or agencies differ: the first kind and entry that do.
    """
    first = None
    for kind in kinds:
        try:
            env = WildfireEnv(kind.world, observation=observation, reward=reward, device=torch.device("cpu"))
        except ValueError as error:
            raise ConfigError(f"mixture.kinds.{kind.name}: {error}") from None
        here = signature(env)
        first = first or here
        other = differing(first, here)
        if other is not None:
            raise ConfigError(
                f"mixture.kinds.{kind.name}: one team must see and do the same in all kinds, and its {other} differs "
                f"from that of {kinds[0].name}"
            )
