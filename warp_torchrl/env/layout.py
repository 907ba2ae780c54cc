"""TorchRL's layout of what an environment is given and gives: actions checked, observations laid out and packed."""

from typing import Any

import torch
from tensordict import TensorDict
from torch import Tensor

from warp_torchrl.env.scene import Observations
from warp_torchrl.system.device import is_same
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World


def checked_action(
    action: Tensor | None, shape: tuple[int, ...], device: torch.device | None, limit: int | None
) -> Tensor:
    """Return the team's actions.

    Args:
        action: As they were given.
        shape: [B, A].
        device: Where the worlds live.
        limit: Number of actions; None does not read whether they are in range.

    Raises:
        ValueError: If they are missing, out of range, or of another shape, type or device.
    """
    if action is None:
        raise ValueError('("agents", "action") must be given: an int64 tensor of shape [worlds, agents]')
    if action.dtype != torch.int64 or tuple(action.shape) != shape:
        raise ValueError(
            f'("agents", "action") must be int64 of shape {list(shape)}, got {action.dtype} {list(action.shape)}'
        )
    if not is_same(action.device, device):
        raise ValueError(f'("agents", "action") must be on {device}, got {action.device}')
    if limit is not None and not ((action >= 0) & (action < limit)).all():
        raise ValueError(
            f'("agents", "action") must be in 0..{limit - 1}, got {int(action.min())}..{int(action.max())}'
        )
    return action


def laid_out(world: World, state: WorldState, observed: Observations, episode_reward: Tensor) -> dict[str, Any]:
    """Return what is observed of worlds by TorchRL's names, nested as in a tensordict, without rewards.

    Args:
        world: Their rules.
        state: The worlds.
        observed: Of them.
        episode_reward: Of their episodes so far, float32 [B].
    """

    def of_team(entries: dict[str, Tensor]) -> Tensor | dict[str, Tensor]:
        return entries.get("", entries)

    roles = world.team.table(state.cells.device).index.repeat(len(state.step), 1)
    agents = {"observation": of_team(observed.entries), "action_mask": observed.action_mask, "role": roles}
    agents |= {} if observed.radio is None else {"radio": observed.radio}
    serves = world.agencies.serves(state)
    agents |= {} if serves is None else {"agency": serves.clone()}
    agents |= {"sent": of_team(sent)} if (sent := world.hearing.shown(state)) else {}
    paid = episode_reward.clone()  # the environment adds to its own
    info = observed.metrics | {"episode_reward": paid, "episode_length": state.step.to(torch.float32)}
    return {
        "agents": agents,
        **({} if observed.state is None else {"state": observed.state}),
        "info": {name: value[:, None] for name, value in info.items()},
        "done": state.done[:, None],
        "terminated": state.terminated[:, None].clone(),
        "truncated": state.truncated[:, None].clone(),
    }


def packed(entries: dict[str, Any]) -> TensorDict:
    """Return what ``laid_out`` returned as a tensordict [B]."""
    mask = entries["agents"]["action_mask"]
    team, device = mask.shape[:2], mask.device  # without a device a tensordict copies those that it holds

    def unchecked(entries: dict[str, Any], shape: torch.Size) -> TensorDict:
        # Of one world, to check shapes and devices of our own is a sixth of the calls of a step.
        return TensorDict._new_unsafe(entries, shape, device)

    agents = {
        name: TensorDict(each, batch_size=team, device=device) if isinstance(each, dict) else each
        for name, each in entries["agents"].items()
    }
    nested = {"agents": unchecked(agents, team), "info": unchecked(entries["info"], team[:1])}
    return unchecked({**entries, **nested}, team[:1])
