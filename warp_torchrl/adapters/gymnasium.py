"""The environment of one agent as a Gymnasium ``Env``, and a batch of it as a ``VectorEnv``."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from warp_torchrl.adapters.screen import FRAMES_PER_SECOND, RENDER_MODES, Screen
from warp_torchrl.adapters.worlds import Seen, Worlds, action_number, observation_space, whole_number

Observation = np.ndarray | dict[str, np.ndarray]


class FireExtinguishingEnv(gymnasium.Env[Observation, int]):
    """One world with one agent (the paper's name for it); also ``gymnasium.make("Wildfire-v0", ...)``.

    Observations are those of an agent of ``parallel_env``: a flat ``Dict`` with ``action_mask``, or in preset ``paper``
    one ``Box``, with ``action_mask`` in ``info``. Infos hold the world's metrics.

    Args:
        scenario: One of ``conf/scenario``, with one agent.
        seed: Of the world; None draws one at the first reset, as Gymnasium has it.
        render_mode: ``rgb_array``, or ``human`` for a window, which follows every step.
        device: Where the world lives; observations come back as numpy.
        overrides: In the command line's grammar, ``["fire=paper", "horizon=64"]``.
        more: Further overrides by name, ``observation="paper"``.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
        ValueError: If the team has more than one agent, the render mode is unknown, or the seed is no whole number in
            0..2**62.
        RuntimeError: If a window is asked for where there is no display or no matplotlib.
    """

    metadata: dict[str, Any] = {"render_modes": list(RENDER_MODES), "render_fps": FRAMES_PER_SECOND}  # noqa: RUF012
    observation_space: spaces.Space[Any]
    action_space: spaces.Space[Any]

    def __init__(
        self,
        scenario: str = "single",
        *,
        seed: int | None = None,
        render_mode: str | None = None,
        device: torch.device | str = "cpu",
        overrides: Sequence[str] = (),
        **more: object,
    ) -> None:
        self._worlds = Worlds(scenario, n_worlds=1, seed=seed, device=device, overrides=overrides, more=more)
        _check_alone(self._worlds, scenario)
        self.render_mode = render_mode
        self._screen = Screen(self._worlds.picture, render_mode, f"{scenario} (warp_torchrl)")
        self.observation_space = observation_space(self._worlds.env)
        self.action_space = spaces.Discrete(self._worlds.n_actions)
        self._mask = np.ones(self._worlds.n_actions, dtype=bool)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode: episode 0 of a given seed, else the next one.

        Args:
            seed: Of the world.
            options: There are none.

        Returns:
            Observation and info.

        Raises:
            ValueError: If the seed is no whole number in 0..2**62.
        """
        now = self._worlds.reset(seed)
        super().reset(seed=None if seed is None else int(seed))
        return self._shown(now)

    def step(self, action: int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Let the agent act.

        Args:
            action: A whole number.

        Returns:
            Observation, reward, terminated, truncated, info.

        Raises:
            RuntimeError: Before the first reset, and after the episode's end.
            ValueError: If the action is none.
        """
        if self._worlds.ended[0]:
            raise RuntimeError("the episode has ended: call reset() before step()")
        number = action_number("action", action, self._worlds.n_actions)
        now = self._worlds.step(np.array([[number]], dtype=np.int64))
        observation, info = self._shown(now)
        return observation, float(now.reward[0, 0]), bool(now.terminated[0]), bool(now.truncated[0]), info

    def action_masks(self) -> np.ndarray:
        """Return which actions would do something, bool [actions]; sb3-contrib asks for it by this name."""
        return self._mask.copy()

    def render(self) -> np.ndarray | None:
        """Return the picture, uint8 [H * s, W * s, 3], in mode ``rgb_array``; show it in mode ``human``."""
        return self._screen.render()

    def close(self) -> None:
        """Close the window, if there is one."""
        self._screen.close()

    def _shown(self, now: Seen) -> tuple[Observation, dict[str, Any]]:
        self._mask = now.action_mask[0, 0].astype(bool)
        self._screen.refresh()
        return now.of_agent(0, 0), now.info_of_agent(0, 0)


gym_env = FireExtinguishingEnv
"""The same, beside ``parallel_env``."""


class FireExtinguishingVectorEnv(VectorEnv[Observation, np.ndarray, np.ndarray]):
    """A batch of worlds with one agent each, stepped at once; also ``gymnasium.make_vec("Wildfire-v0", num_envs=B)``.

    Finished worlds start anew by Gymnasium's ``AutoresetMode.NEXT_STEP``: the step that ends an episode shows its last
    observation; the next step ignores the world's action and shows the first observation of its next episode, with
    reward 0 and neither flag set.

    Args:
        num_envs: B.
        scenario: One of ``conf/scenario``, with one agent.
        seed: World i draws with ``seed + i``; None draws a seed at the first reset, as Gymnasium has it.
        render_mode: ``rgb_array`` or None.
        device: Where the worlds live; observations come back as numpy.
        overrides: In the command line's grammar.
        more: Further overrides by name.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
        ValueError: If ``num_envs`` is not positive, the team has more than one agent, the render mode is unknown, or
            the seed is no whole number in 0..2**62.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012
        "render_modes": ["rgb_array"],
        "render_fps": FRAMES_PER_SECOND,
        "autoreset_mode": AutoresetMode.NEXT_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str = "single",
        *,
        seed: int | None = None,
        render_mode: str | None = None,
        device: torch.device | str = "cpu",
        overrides: Sequence[str] = (),
        **more: object,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or rgb_array for a batch, got {render_mode!r}")
        num_envs = whole_number("num_envs", num_envs)
        self._worlds = Worlds(scenario, n_worlds=num_envs, seed=seed, device=device, overrides=overrides, more=more)
        _check_alone(self._worlds, scenario)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space = observation_space(self._worlds.env)
        self.single_action_space = spaces.Discrete(self._worlds.n_actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every world: episode 0 of given seeds, else the next one of each.

        Args:
            seed: World i draws with ``seed + i``, or with ``seed[i]``.
            options: There are none; ``reset_mask`` is refused, since worlds start anew by themselves.

        Returns:
            Observations, batched, and infos: an array for each metric, and ``_name``, where it holds.

        Raises:
            ValueError: If a seed is no whole number in 0..2**62, or there are not as many as worlds.
        """
        if options is not None and "reset_mask" in options:
            raise ValueError("options['reset_mask'] must be left out: finished worlds start anew by themselves")
        now = self._worlds.reset(seed)
        super().reset(seed=None if seed is None or np.ndim(seed) else whole_number("seed", seed))
        return now.of_agent(slice(None), 0), self._info(now)

    def step(self, actions: np.ndarray) -> tuple[Observation, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Let every agent act, or start the next episode where the last step ended one.

        Args:
            actions: Whole numbers, [B].

        Returns:
            Observations, rewards float64 [B], terminations bool [B], truncations bool [B], infos.

        Raises:
            RuntimeError: Before the first reset.
            ValueError: If actions are not whole numbers in range, one a world.
        """
        ended = self._worlds.ended
        now = self._worlds.step(self._checked(actions)[:, None])
        if ended.any():
            now = self._worlds.restart(ended, now.reward)
        reward = now.reward[:, 0].astype(np.float64)
        return now.of_agent(slice(None), 0), reward, now.terminated, now.truncated, self._info(now)

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Return each world's picture, uint8 [H * s, W * s, 3], in mode ``rgb_array``."""
        return None if self.render_mode is None else tuple(self._worlds.frames())

    def _checked(self, actions: np.ndarray) -> np.ndarray:
        given, n_actions = np.asarray(actions), self._worlds.n_actions
        if given.shape != (self.num_envs,) or given.dtype.kind not in "iu":
            raise ValueError(
                f"actions must be whole numbers of shape [{self.num_envs}], got {given.dtype} {list(given.shape)}"
            )
        if given.min() < 0 or given.max() >= n_actions:
            raise ValueError(f"actions must be in 0..{n_actions - 1}, got {given.min()}..{given.max()}")
        return given.astype(np.int64)

    def _info(self, now: Seen) -> dict[str, Any]:
        values = now.info_of_agent(slice(None), 0)
        everywhere = {f"_{name}": np.ones(self.num_envs, dtype=bool) for name in values}
        return {**values, **everywhere}


def _check_alone(worlds: Worlds, scenario: str) -> None:
    if worlds.env.n_agents != 1:
        raise ValueError(
            f"team.n_agents must be 1 for Gymnasium, got {worlds.env.n_agents} in {scenario}; "
            "warp_torchrl.adapters.parallel_env takes any team"
        )
