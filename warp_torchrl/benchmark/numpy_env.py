"""The paper's stack: a PettingZoo environment of one world in NumPy."""

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from warp_torchrl.benchmark.numpy_team import NumpyTeam
from warp_torchrl.benchmark.numpy_terrain import light, new_ground, start_cells
from warp_torchrl.benchmark.numpy_world import NumpyWorld
from warp_torchrl.env.reward import Efficiency
from warp_torchrl.world.law.fire import Fire
from warp_torchrl.world.state.state import Action, Cover

_WIND = 4.0  # m/s, as conf/wind/uniform.yaml
_REWARD = Efficiency()


class NumpyFireEnv(ParallelEnv[str, np.ndarray, int]):
    """Bulldozers against a fire as in the scenario ``large``: its landscape, wind, law ``spread`` and actions, and
    the team's mean of its reward.

    Args:
        size: (H, W) [cells].
        n_agents: A.
        steps_per_tick: Agent steps to a fire tick.
        horizon: Agent steps to an episode.
        n_fires: Patches of fire at the start.
        radius: r of the view [cells].
        seed: Of the world; None draws one at the first reset, such as for copies that shall differ.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "numpy_fire_v0", "render_modes": [], "is_parallelizable": True}
    render_mode = None

    def __init__(
        self,
        size: tuple[int, int] = (64, 64),
        n_agents: int = 4,
        steps_per_tick: int = 1,
        horizon: int = 512,
        n_fires: int = 3,
        radius: int = 3,
        seed: int | None = None,
    ) -> None:
        self.size, self.n_agents, self.steps_per_tick = size, n_agents, steps_per_tick
        self.horizon, self.n_fires, self.radius = horizon, n_fires, radius
        self.fire = Fire()
        self.possible_agents = [f"bulldozer_{index}" for index in range(n_agents)]
        self.agents: list[str] = []
        seen = spaces.Box(0.0, 1.0, (3 * (2 * radius + 1) ** 2,), np.float32)
        self.observation_spaces = dict.fromkeys(self.possible_agents, seen)
        self.action_spaces = {name: spaces.Discrete(len(Action)) for name in self.possible_agents}
        self._rng = None if seed is None else _generator(seed)

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the space of an agent's observations."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Return the space of an agent's actions."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, dict[str, Any]]]:
        """Start an episode, with draws from a seed where one is given; there are no options."""
        if seed is not None or self._rng is None:
            self._rng = _generator(seed)
        rng = self._rng
        cover, forest = new_ground(rng, self.size)
        alpha = np.array(self.fire.alpha)[cover]
        lit = light(rng, (forest >= self.fire.youngest_fuel) & (alpha > 0.0), self.n_fires)
        position = start_cells(rng, (cover == Cover.LAKE) | lit, self.n_agents)
        angle = rng.random() * 2.0 * np.pi
        wind = np.array([np.cos(angle), np.sin(angle)], dtype=np.float32).reshape(2, 1, 1) * np.float32(_WIND)
        self.world = NumpyWorld(self.fire, cover, forest, wind)
        self.world.ignite(lit)
        self.world.tick(self._draws())  # the head start of conf/ignition/central.yaml
        self.team = NumpyTeam(self.world, cover, position, self.radius, _REWARD)
        self.agents, self._step = list(self.possible_agents), 0
        return self._by_agent(self.team.observe()), {name: {} for name in self.agents}

    def step(
        self, actions: dict[str, int]
    ) -> tuple[dict[str, np.ndarray], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let every agent act; return observations, rewards, terminations, truncations and infos by agent."""
        everyone = self.possible_agents
        acts = self.team.act(np.array([actions[name] for name in everyone]))
        self._step += 1
        if self._step % self.steps_per_tick == 0:
            self.world.tick(self._draws())
        terminated, truncated = not self.world.is_alight, self._step >= self.horizon
        reward = self.team.earn(acts, terminated)
        if terminated or truncated:
            self.agents = []
        return (
            self._by_agent(self.team.observe()),
            dict.fromkeys(everyone, reward),
            dict.fromkeys(everyone, terminated),
            dict.fromkeys(everyone, truncated),
            {name: {} for name in everyone},
        )

    def _draws(self) -> np.ndarray:
        return self._rng.random(self.world.cells.size, dtype=np.float32)  # type: ignore[union-attr]

    def _by_agent(self, seen: np.ndarray) -> dict[str, np.ndarray]:
        return dict(zip(self.possible_agents, seen, strict=True))


def _generator(seed: int | None) -> np.random.Generator:
    return np.random.Generator(np.random.SFC64(seed))
