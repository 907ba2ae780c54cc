"""The environment as a PettingZoo ``ParallelEnv``."""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.utils import seeding
from pettingzoo import AECEnv, ParallelEnv
from pettingzoo.utils.conversions import parallel_to_aec

from warp_torchrl.api.adapters.screen import FRAMES_PER_SECOND, Screen
from warp_torchrl.api.adapters.worlds import NumpyStep, NumpyWorlds, action_number

RENDER_MODES = ("human", "rgb_array")
Observation = np.ndarray | dict[str, np.ndarray]


class FireExtinguishingEnvParallel(ParallelEnv[str, Observation, int]):
    """One world, whose team acts at once (the paper's name for it).

    An agent's observation is a flat ``Dict`` of ``view`` uint8 [C, V, V], ``status`` float32 [F], ``picture`` uint8
    [3, 15, 15] (preset ``surroundings``) and ``action_mask`` int8 [actions]; in preset ``paper`` one ``Box``, float32
    [3 (2 r + 1)^2], with ``action_mask`` in ``infos[agent]``. Infos hold the world's metrics. All agents end together,
    and ``agents`` is then empty.

    Args:
        scenario: One of ``conf/scenario``.
        seed: Of the world; None draws one at the first reset, so that copies made before differ.
        render_mode: ``rgb_array``; or ``human``, which follows every step: a window where there are a display and
            pygame, else pictures in the terminal.
        layout: ``dict``; or ``flat``, in every preset ``observation``, one float32 vector, beside ``action_mask``: the
            entries in the order of their names, bytes divided by 255.
        device: Device of the world; observations are numpy arrays.
        compile: Whether steps are compiled with ``torch.compile``: the first then takes half a minute, or some seconds
            once such an environment has been compiled on this machine.
        max_cycles: Steps to an episode, ``horizon``; None leaves the scenario's.
        overrides: In the command line's grammar, ``["fire=paper", "team.n_agents=3"]``.
        more: Further overrides by name, ``observation="paper"``.

    Attributes:
        possible_agents: ``bulldozer_0``, ``uav_0`` and so on, numbered within their role.
        agents: Agents whose episode continues.
        observation_spaces: By agent.
        action_spaces: By agent.
        state_space: Of ``state()``.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule; a ``TypeError`` too where a name is no key.
        ValueError: If the render mode or the layout is unknown or the seed is no whole number in 0..2**62.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "warp_torchrl_v0",
        "render_modes": list(RENDER_MODES),
        "render_fps": FRAMES_PER_SECOND,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        scenario: str = "default",
        *,
        seed: int | None = None,
        render_mode: str | None = None,
        layout: str = "dict",
        device: torch.device | str = "cpu",
        compile: bool = False,
        max_cycles: int | None = None,
        overrides: Sequence[str] = (),
        **more: object,
    ) -> None:
        more = more if max_cycles is None else {**more, "horizon": max_cycles}
        self._worlds = NumpyWorlds(
            scenario,
            n_worlds=1,
            seed=seed,
            layout=layout,
            device=device,
            compile=compile,
            overrides=overrides,
            more=more,
        )
        self.render_mode = render_mode
        self._screen = Screen(self._worlds.picture, render_mode, RENDER_MODES, f"{scenario} (warp_torchrl)")
        env = self._worlds.env
        self.possible_agents = list(env.agent_names)
        self.agents: list[str] = []
        self.observation_spaces = {name: self._worlds.observation_space for name in self.possible_agents}
        self.action_spaces = {name: spaces.Discrete(self._worlds.n_actions) for name in self.possible_agents}
        self.state_space = self._worlds.state_space
        self._np_random: np.random.Generator | None = None

    def observation_space(self, agent: str) -> spaces.Box | spaces.Dict:
        """Return the space of an agent's observations, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Return the space of an agent's actions, always the same object."""
        return self.action_spaces[agent]

    @property
    def np_random(self) -> np.random.Generator:
        """Return a numpy generator, which the worlds do not use; SuperSuit reads this attribute."""
        if self._np_random is None:
            self._np_random, _ = seeding.np_random()
        return self._np_random

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        """Start an episode: episode 0 of a given seed, else the next one.

        Args:
            seed: Of the world.
            options: Not used.

        Returns:
            Observations and infos by agent.

        Raises:
            ValueError: If the seed is no whole number in 0..2**62.
        """
        now = self._worlds.reset(seed)
        if seed is not None:
            self._np_random, _ = seeding.np_random(int(seed))
        self.agents = list(self.possible_agents)
        self._screen.refresh()
        return self._by_agent(now)

    def step(
        self, actions: Mapping[str, int]
    ) -> tuple[dict[str, Observation], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Let every agent act.

        Args:
            actions: A whole number for each agent.

        Returns:
            Observations, rewards, terminations, truncations and infos by agent.

        Raises:
            RuntimeError: Before the first reset, and after the episode's end.
            ValueError: If an agent is missing or unknown, or an action is out of range.
        """
        now = self._worlds.step(self._joint(actions))
        observations, infos = self._by_agent(now)
        rewards = dict(zip(self.possible_agents, now.reward[0].tolist()))
        terminated, truncated = bool(now.terminated[0]), bool(now.truncated[0])
        if terminated or truncated:
            self.agents = []
        self._screen.refresh()
        everyone = self.possible_agents
        return observations, rewards, dict.fromkeys(everyone, terminated), dict.fromkeys(everyone, truncated), infos

    def state(self) -> np.ndarray:
        """Return the central critic's state, float32 [C, 16, 16]."""
        return self._worlds.state()[0]

    def render(self) -> np.ndarray | None:
        """Return the image, uint8 [H * s, W * s, 3], in mode ``rgb_array``; display it in mode ``human``."""
        return self._screen.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _joint(self, actions: Mapping[str, int]) -> np.ndarray:
        if self._worlds.ended[0]:
            raise RuntimeError("the episode has ended: call reset() before step()")
        if not isinstance(actions, Mapping) or set(actions) != set(self.agents):
            given = list(actions) if isinstance(actions, Mapping) else type(actions).__name__
            raise ValueError(f"actions must be a dict with one of each of {self.agents}, got {given}")
        numbers = [
            action_number(f"action of {name}", actions[name], self._worlds.n_actions) for name in self.possible_agents
        ]
        return np.array([numbers], dtype=np.int64)

    def _by_agent(self, now: NumpyStep) -> tuple[dict[str, Observation], dict[str, dict[str, Any]]]:
        agents = list(enumerate(self.possible_agents))
        observations = {name: now.of_agent(0, index) for index, name in agents}
        return observations, {name: now.info_of_agent(0, index) for index, name in agents}


parallel_env = FireExtinguishingEnvParallel
"""The same class under PettingZoo's usual name."""


def env(*args: Any, **kwargs: Any) -> AECEnv:
    """Return an ``AECEnv``, in which agents act in turns; arguments of ``parallel_env``."""
    return parallel_to_aec(parallel_env(*args, **kwargs))
