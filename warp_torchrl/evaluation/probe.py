"""Linear probes of the messages of a team (Alain and Bengio 2016).

A linear map is fitted from messages to what their senders know, on some worlds, and scored on others. The same is done
for the messages of the same networks with random weights: whatever those contain comes from the observation, and was
not learned.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from copy import deepcopy
from dataclasses import dataclass
from typing import NamedTuple

import torch
from tensordict.nn import TensorDictModuleBase
from torch import Tensor, nn
from torchrl.envs.utils import set_exploration_type

from warp_torchrl.env import WildfireEnv
from warp_torchrl.heuristics.base import known_fire, nearest_marked, place
from warp_torchrl.models.messages import Round
from warp_torchrl.runs.policies.trained import MODES, TrainedPolicy
from warp_torchrl.world.state.state import WorldState

_RIDGE = 1e-3
"""Weight of the squared coefficients, for each message."""


class Reading(NamedTuple):
    """Quality of a probe: R^2 on other worlds; 1 explains everything, 0 no more than the mean."""

    what: str
    trained: float
    drawn_anew: float
    messages: int  # of which it was read, of the worlds that judge


@dataclass(frozen=True)
class _Heard:
    """Messages of some steps, with their senders' knowledge."""

    messages: Tensor  # float32 [n, M]
    known: dict[str, Tensor]  # float32 [n] each; NaN where it does not apply


def probe(policy: TrainedPolicy, env: WildfireEnv, first_seed: int) -> list[Reading]:
    """Return the probes of a policy's first round of messages, one row for each quantity.

    Args:
        policy: Whose agents talk, fitted to the environment.
        env: Plays one episode in each of its worlds: the first half of them fit, the others judge.
        first_seed: Seed of world 0.

    Raises:
        ValueError: If its agents do not talk, or the environment has fewer than two worlds.
    """
    if not policy.talks:
        raise ValueError("policy must be one whose agents talk (model.messages=graph)")
    if env.batch_size[0] < 2:
        raise ValueError(f"episodes must be at least 2, got {env.batch_size[0]}")
    trained, anew = _collect(policy, env, first_seed)
    names = list(trained[0].known)
    return [Reading(name, _share(trained, name), _share(anew, name), _count(trained[1], name)) for name in names]


def _collect(policy: TrainedPolicy, env: WildfireEnv, first_seed: int) -> tuple[list[_Heard], list[_Heard]]:
    """Return the messages of a policy, and of the same networks with random weights, by the half of the worlds."""
    other, worlds = drawn_anew(policy), torch.arange(env.batch_size[0], device=env.device)
    halves = worlds < len(worlds) // 2, worlds >= len(worlds) // 2
    trained: list[list[_Heard]] = [[], []]
    anew: list[list[_Heard]] = [[], []]
    with torch.random.fork_rng(), torch.no_grad(), set_exploration_type(MODES[policy.mode]):
        torch.manual_seed(first_seed)
        env.set_seed(first_seed, static_seed=True)
        now = env.reset()
        for _ in range(env.world.horizon):
            with _listening(other) as theirs:
                other(now.copy())
            with _listening(policy) as ours:
                acted = policy(now)
            known = _known(env.shared_state, env)
            for place_of, half in enumerate(halves):
                rows = half & ~now["done"][:, 0]
                what = {name: value[rows].flatten() for name, value in known.items()}
                trained[place_of].append(_Heard(ours[0][rows].flatten(0, 1), what))
                anew[place_of].append(_Heard(theirs[0][rows].flatten(0, 1), what))
            now = env.step(acted)["next"]
            if now["done"].all():
                break
    return [_joined(each) for each in trained], [_joined(each) for each in anew]


def _joined(parts: list[_Heard]) -> _Heard:
    known = {name: torch.cat([each.known[name] for each in parts]) for name in parts[0].known}
    return _Heard(torch.cat([each.messages for each in parts]), known)


def _known(state: WorldState, env: WildfireEnv) -> dict[str, Tensor]:
    """Return the quantities that each agent knows, float32 [B, A] each; NaN where it knows of no fire."""
    knows, index = nearest_marked(state, known_fire(state, env.world))
    fire = place(index, state).to(torch.float32).masked_fill(~knows[..., None], torch.nan)
    offset = fire - state.vehicles.position
    row, column = state.vehicles.position.to(torch.float32).unbind(-1)
    return {
        "whether it knows of fire": knows.to(torch.float32),
        "row of the nearest fire it knows of": fire[..., 0],
        "column of the nearest fire it knows of": fire[..., 1],
        "rows to the nearest fire it knows of": offset[..., 0],
        "columns to the nearest fire it knows of": offset[..., 1],
        "its own row": row,
        "its own column": column,
    }


def _share(halves: list[_Heard], name: str) -> float:
    """Return R^2 of the linear map that is fitted on the first half, on the second."""
    inputs, targets = [], []
    for half in halves:
        applies = ~half.known[name].isnan()
        messages = half.messages[applies].double()
        inputs.append(torch.cat((messages, torch.ones_like(messages[:, :1])), dim=-1))
        targets.append(half.known[name][applies].double())
    if not len(targets[0]) or not len(targets[1]):
        return float("nan")
    gram = inputs[0].T @ inputs[0]
    ridge = _RIDGE * len(inputs[0]) * torch.eye(len(gram), dtype=gram.dtype)
    weights = torch.linalg.solve(gram + ridge, inputs[0].T @ targets[0])
    error = (inputs[1] @ weights - targets[1]).square().sum()
    return float(1.0 - error / (targets[1] - targets[1].mean()).square().sum())


def _count(half: _Heard, name: str) -> int:
    return int((~half.known[name].isnan()).sum())


@contextmanager
def _listening(policy: TensorDictModuleBase) -> Iterator[list[Tensor]]:
    """Yield a list to which the first round's messages are added, float32 [B, A, M], as the map shows them."""
    heard: list[Tensor] = []
    first = next(each for each in policy.modules() if isinstance(each, Round))
    hook = first.register_forward_pre_hook(lambda made, given: heard.append(made.told(given[0], given[2])))
    try:
        yield heard
    finally:
        hook.remove()


def drawn_anew(policy: TrainedPolicy) -> TrainedPolicy:
    """Return a copy of a policy whose linear layers have random weights, always the same."""
    other = deepcopy(policy)
    with torch.random.fork_rng(), torch.no_grad():
        torch.manual_seed(0)
        for layer in other.modules():
            if isinstance(layer, nn.Linear):
                nn.init.orthogonal_(layer.weight, 2.0**0.5)
                if layer.bias is not None:
                    nn.init.zeros_(layer.bias)
    return other
