"""Speed of the environment, and of the paper's stack: a PettingZoo environment of one world in NumPy."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from torch import Tensor

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.tables import entry, spread_of, table
from warp_torchrl.benchmark.timing import mean_rate, take_turns
from warp_torchrl.world.world import World

if TYPE_CHECKING:
    from warp_torchrl.benchmark.numpy_env import NumpyFireEnv
    from warp_torchrl.env import WildfireEnv

LARGE = ("spread_large", ("team.n_agents=4", "steps_per_tick=1"))
"""The scenario that is measured where none is asked for, and what is changed in it."""
_EAGER, _COMPILED, _PEER = "environment", "compiled", "numpy, PettingZoo"
_FEWEST_STEPS, _NUMPY_EPISODES = 25, 8  # in a repeat
_LONGEST = 1024  # steps of the longest episode that is waited for


def environment_speed(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7, compiled: bool = True
) -> list[dict[str, Any]]:
    """Measure agent steps a second of the environment alone, and of the paper's stack for the same map and team.

    Random actions, observations, rewards and resets; of ours metrics, action masks and the critic's state as well.
    A repeat holds whole episodes, so that starts count: of the peer some from end to end; of ours as many steps as the
    longest first episode of a world has, after which worlds end at different times. Rates are means over all repeats.

    Args:
        scenario: One of ``conf/scenario``. The paper's stack takes the sizes of its map, team and view and its clock
            from it; all else is as in ``large``.
        n_worlds: B; the paper's stack steps one.
        device: Where the worlds live.
        overrides: In the command line's grammar.
        repeats: Times that each is measured.
        compiled: Whether to measure fused steps too, which take a while to compile.

    Returns:
        A row for each, with ``agent_steps_per_second`` and how many times faster than the paper's stack it is.
    """
    env = make_env(scenario, n_worlds=n_worlds, device=device, overrides=overrides)
    ways, skipped = {_EAGER: env}, []
    if compiled:
        try:
            fused = make_env(scenario, n_worlds=n_worlds, device=device, overrides=overrides, compile=True)
            if fused.why_eager is None:
                ways[_COMPILED] = fused
            else:
                skipped.append({"what": _COMPILED, "skipped": fused.why_eager})
        except ValueError as error:
            skipped.append({"what": _COMPILED, "skipped": str(error)})
    contenders = {name: whole_episodes(way) for name, way in ways.items()}
    theirs = _random_numpy_play(paper_stack(env.world, env.observation.radius, seed=0))
    contenders[_PEER] = partial(theirs, _NUMPY_EPISODES)
    steps: dict[str, list[int]] = {name: [] for name in contenders}

    def counted(name: str) -> None:
        steps[name].append(contenders[name]() * env.n_agents)

    seconds = take_turns({name: partial(counted, name) for name in contenders}, repeats, device)
    common = {"scenario": scenario, "agents": env.n_agents, "size": "{} x {}".format(*env.world.size)}
    rows: list[dict[str, Any]] = [
        {"what": name, "worlds": 1 if name == _PEER else n_worlds, **common}
        | mean_rate("agent_steps_per_second", steps[name][1:], seconds[name])  # the first call does not count
        for name in contenders
    ]
    peer = rows[-1]["agent_steps_per_second"]
    return [row | {"ratio": row["agent_steps_per_second"] / peer} for row in rows] + skipped


def random_play(env: "WildfireEnv") -> Callable[[int], Tensor]:
    """Return a function that plays random actions for a number of steps, and returns which worlds ended, bool [B, 1].

    Worlds that end start again.
    """
    now = env.reset()

    def play(steps: int) -> Tensor:
        nonlocal now
        ended = torch.zeros_like(now["done"])
        for _ in range(steps):
            left, now = env.step_and_maybe_reset(env.rand_action(now))
            ended |= left["next", "done"]
        return ended

    return play


def whole_episodes(env: "WildfireEnv") -> Callable[[], int]:
    """Return a function that plays random actions for as many steps as the longest first episode of a world has.

    Worlds that end start again. It returns the worlds' steps.
    """
    play = random_play(env)
    ended, longest = play(1), 1
    while longest < _LONGEST and not ended.all():
        ended, longest = ended | play(1), longest + 1
    longest = max(longest, _FEWEST_STEPS)

    def play_again() -> int:
        play(longest)
        return longest * env.batch_size[0]

    return play_again


def paper_stack(world: World, radius: int, seed: int | None = None) -> "NumpyFireEnv":
    """Return the paper's stack for a world's map, team and clock.

    Args:
        world: The scenario's rules.
        radius: r of the view [cells].
        seed: Of the NumPy world; None draws one at the first reset.
    """
    from warp_torchrl.benchmark.numpy_env import NumpyFireEnv

    return NumpyFireEnv(
        size=world.size,
        n_agents=world.team.n_agents,
        steps_per_tick=world.steps_per_tick,
        horizon=world.horizon,
        n_fires=getattr(world.ignition, "count", 1),
        radius=radius,
        seed=seed,
    )


def rate_table(rows: list[dict[str, Any]]) -> str:
    """Return rates, of the environment or of training, as a table for the terminal."""
    columns = [
        entry("", "what"),
        entry("scenario"),
        entry("map", "size"),
        entry("agents"),
        entry("worlds"),
        entry("agent steps/s", "agent_steps_per_second", "{:,.0f}"),
        spread_of("{:,.0f}"),
        entry("x peer", "ratio", "{:.1f}"),
    ]
    return table(columns, rows)


def _random_numpy_play(env: "NumpyFireEnv") -> Callable[[int], int]:
    """Return a function that plays some episodes of random actions from start to end, and returns their steps."""
    rng = np.random.default_rng(0)
    n_actions = env.action_space(env.possible_agents[0]).n

    def play(episodes: int) -> int:
        steps = 0
        for _ in range(episodes):
            env.reset()
            while env.agents:
                env.step(dict(zip(env.agents, rng.integers(n_actions, size=len(env.agents)))))
                steps += 1
        return steps

    return play
