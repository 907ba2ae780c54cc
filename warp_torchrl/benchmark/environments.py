"""How fast the environment is, and the paper's stack: a PettingZoo environment of one world in NumPy."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_torchrl.api import make_env
from warp_torchrl.benchmark.tables import entry, spread_of, table
from warp_torchrl.benchmark.timing import spread, take_turns
from warp_torchrl.world.world import World

if TYPE_CHECKING:
    from warp_torchrl.benchmark.numpy_env import NumpyFireEnv
    from warp_torchrl.env import WildfireEnv

LARGE = ("large", ("team.n_agents=4", "steps_per_tick=1"))
"""The scenario that is measured where none is asked for, and what is changed in it."""
_EAGER, _COMPILED, _PEER = "environment", "compiled", "numpy, PettingZoo"
_STEPS, _NUMPY_STEPS = 25, 200  # in a repeat
_WARM_UP = 128  # steps at most, until worlds end at different times


def environment_speed(
    scenario: str, n_worlds: int, device: str, overrides: Sequence[str] = (), repeats: int = 7, compiled: bool = True
) -> list[dict[str, Any]]:
    """Measure agent steps a second of the environment alone, and of the paper's stack for the same map and team.

    Random actions, observations, rewards and resets; of ours metrics, action masks and the critic's state as well.

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
    contenders, worlds = {}, {name: (n_worlds, _STEPS) for name in ways} | {_PEER: (1, _NUMPY_STEPS)}
    for name, way in ways.items():
        play = random_play(way)
        play(min(env.world.horizon // 2, _WARM_UP))
        contenders[name] = partial(play, _STEPS)
    theirs = _random_numpy_play(paper_stack(env.world, env.observation.radius, seed=0))
    contenders[_PEER] = partial(theirs, _NUMPY_STEPS)
    common = {"scenario": scenario, "agents": env.n_agents, "size": "{} x {}".format(*env.world.size)}
    rows: list[dict[str, Any]] = []
    for name, seconds in take_turns(contenders, repeats, device).items():
        count, steps = worlds[name]
        rates = [steps * count * env.n_agents / second for second in seconds]
        rows.append({"what": name, "worlds": count, **common} | spread("agent_steps_per_second", rates))
    peer = rows[-1]["agent_steps_per_second"]
    return [row | {"ratio": row["agent_steps_per_second"] / peer} for row in rows] + skipped


def random_play(env: "WildfireEnv") -> Callable[[int], None]:
    """Return a function that plays random actions for a number of steps, and resets worlds as they end."""
    now = env.reset()

    def play(steps: int) -> None:
        nonlocal now
        for _ in range(steps):
            _, now = env.step_and_maybe_reset(env.rand_action(now))

    return play


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


def _random_numpy_play(env: "NumpyFireEnv") -> Callable[[int], None]:
    rng = np.random.default_rng(0)
    n_actions = env.action_space(env.possible_agents[0]).n

    def play(steps: int) -> None:
        for _ in range(steps):
            if not env.agents:
                env.reset()
            env.step(dict(zip(env.agents, rng.integers(n_actions, size=len(env.agents)))))

    return play
