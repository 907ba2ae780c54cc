"""TorchRL specs of the environment: shape, dtype and range of every input and output."""

import inspect
from collections.abc import Iterable
from keyword import iskeyword
from typing import NamedTuple

import torch
from tensordict import TensorDict
from torchrl.data import Binary, Bounded, Categorical, Composite, Unbounded

from warp_torchrl.env.metrics import METRICS, metric_rows
from warp_torchrl.env.observation import Observation, Space, critic_state
from warp_torchrl.world.world import World

EPISODE_METRICS = (*METRICS, "episode_reward", "episode_length")
"""Entries of ``info`` of every world: the metrics, the team's mean return so far, and the steps so far."""
_FLAGS = ("done", "terminated", "truncated")
_TAKEN = {name for kind in (Composite, TensorDict) for name in inspect.signature(kind.__init__).parameters}
"""Names of parameters, which no entry can have: TorchRL passes entries as keywords."""


class Specs(NamedTuple):
    """The four specs of an environment."""

    observation: Composite
    action: Composite
    reward: Composite
    done: Composite


def episode_metrics(world: World) -> tuple[str, ...]:
    """Return the entries of ``info`` of a world: ``EPISODE_METRICS``, then those that users or its mechanics add."""
    names = [row.name for row in metric_rows(world)]
    return (*EPISODE_METRICS, *(name for name in names if name not in EPISODE_METRICS))


def check_names(names: Iterable[str]) -> None:
    """Check that entries can have these names; "" is the one entry of an observation that is a single tensor.

    Raises:
        ValueError: If one is no identifier, or a word of Python or a parameter of TorchRL's specs.
    """
    for name in names:
        if name and (not name.isidentifier() or iskeyword(name) or name in _TAKEN):
            taken = ", ".join(sorted(_TAKEN))
            raise ValueError(f"observation entries must be named by identifiers, and none of {taken}, got {name!r}")


def make_specs(world: World, observation: Observation, n_worlds: int, device: torch.device) -> Specs:
    """Return the specs of ``n_worlds`` worlds; the team's entries are nested under ``agents``.

    Raises:
        ValueError: If an entry of the observation cannot have its name.
    """
    batch, team = (n_worlds,), (n_worlds, world.team.n_agents)
    n_actions = world.team.n_actions

    def entry(space: Space) -> Bounded:
        low, high = (bound.expand(*team, *space.shape).clone() for bound in space.bounds())
        return Bounded(low, high, dtype=space.dtype, device=device)

    def of_team(**entries: object) -> Composite:
        return Composite(agents=Composite(**entries, shape=team, device=device), shape=batch, device=device)

    shown = observation.spaces(world)
    check_names(shown)
    spaces = {name: entry(space) for name, space in shown.items()}
    seen = of_team(
        observation=spaces[""] if "" in spaces else Composite(spaces, shape=team, device=device),
        action_mask=Binary(n_actions, shape=(*team, n_actions), dtype=torch.bool, device=device),
        role=Categorical(len(world.team.role_names), shape=team, dtype=torch.int64, device=device),
    )
    if world.hearing.sends_vectors:
        reach = float(max(world.size))
        seen["agents", "radio"] = Bounded(-reach, reach, shape=(*team, world.team.n_agents, 3), device=device)
        if world.hearing.is_late:
            seen["agents", "sent"] = seen["agents", "observation"].clone()
    if agencies := len(world.agencies.names):
        seen["agents", "agency"] = Categorical(agencies, shape=team, dtype=torch.int64, device=device)
    seen["state"] = Bounded(-3.0, 256.0, shape=(*batch, *critic_state(observation, world).shape), device=device)
    seen["info"] = Composite(
        {name: Unbounded(shape=(*batch, 1), device=device) for name in episode_metrics(world)},
        shape=batch,
        device=device,
    )
    flags = {name: Categorical(2, shape=(*batch, 1), dtype=torch.bool, device=device) for name in _FLAGS}
    return Specs(
        observation=seen,
        action=of_team(action=Categorical(n_actions, shape=team, dtype=torch.int64, device=device)),
        reward=of_team(reward=Unbounded(shape=(*team, 1), device=device)),
        done=Composite(flags, shape=batch, device=device),
    )
