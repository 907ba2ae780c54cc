"""The environment of one agent as a Gymnasium ``Env``."""

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces

from warp_torchrl.api.adapters.screen import FRAMES_PER_SECOND, Screen
from warp_torchrl.api.adapters.worlds import NumpyStep, NumpyWorlds, action_number

RENDER_MODES = ("rgb_array",)
KEYS = {"w": 0, "e": 1, "d": 2, "c": 3, "x": 4, "z": 5, "a": 6, "q": 7, " ": 8, "f": 9, "s": 10}
"""Action of each key: the keys around ``s`` move, ``s`` stays, space extinguishes, f clears."""
Observation = np.ndarray | dict[str, np.ndarray]


class FireExtinguishingEnv(gymnasium.Env[Observation, int]):
    """One world with one agent (the paper's name for it); also ``gymnasium.make("Wildfire-v0", ...)``.

    Observations are those of an agent of ``parallel_env``: a flat ``Dict`` with ``action_mask``, or in preset ``paper``
    one ``Box``, with ``action_mask`` in ``info``. Infos hold the world's metrics.

    Args:
        scenario: One of ``conf/scenario``, with one agent.
        seed: Of the world; None draws one at the first reset, so that copies made before differ.
        render_mode: ``rgb_array`` or None; ``gymnasium.make`` makes a window of it, ``human``, by Gymnasium's
            ``HumanRendering``, which needs pygame.
        layout: ``dict``; or ``flat``, in every preset ``observation``, one float32 vector, beside ``action_mask``: the
            entries in the order of their names, bytes divided by 255.
        device: Where the world lives; observations come back as numpy.
        compile: Whether steps are compiled with ``torch.compile``: the first then takes half a minute, or some seconds
            once such an environment has been compiled on this machine.
        overrides: In the command line's grammar, ``["fire=paper", "horizon=64"]``.
        more: Further overrides by name, ``observation="paper"``.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule; a ``TypeError`` too where a name is no key.
        ValueError: If the team has more than one agent, the render mode or the layout is unknown, or the seed is no
            whole number in 0..2**62.
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
        layout: str = "dict",
        device: torch.device | str = "cpu",
        compile: bool = False,
        overrides: Sequence[str] = (),
        **more: object,
    ) -> None:
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
        check_alone(self._worlds, scenario)
        self.render_mode = render_mode
        self._screen = Screen(self._worlds.picture, render_mode, RENDER_MODES, f"{scenario} (warp_torchrl)")
        self.observation_space = self._worlds.observation_space
        self.action_space = spaces.Discrete(self._worlds.n_actions)
        self._mask = np.ones(self._worlds.n_actions, dtype=bool)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode: episode 0 of a given seed, else the next one.

        Args:
            seed: Of the world.
            options: Not used.

        Returns:
            Observation and info.

        Raises:
            ValueError: If the seed is no whole number in 0..2**62.
        """
        now = self._worlds.reset(seed)
        super().reset(seed=None if seed is None else int(seed))
        return self._unpack(now)

    def step(self, action: int) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Let the agent act.

        Args:
            action: A whole number.

        Returns:
            Observation, reward, terminated, truncated, info.

        Raises:
            RuntimeError: Before the first reset, and after the episode's end.
            ValueError: If the action is out of range.
        """
        if self._worlds.ended[0]:
            raise RuntimeError("the episode has ended: call reset() before step()")
        number = action_number("action", action, self._worlds.n_actions)
        now = self._worlds.step(np.array([[number]], dtype=np.int64))
        observation, info = self._unpack(now)
        return observation, float(now.reward[0, 0]), bool(now.terminated[0]), bool(now.truncated[0]), info

    def action_masks(self) -> np.ndarray:
        """Return the action mask, bool [actions]; sb3-contrib calls this method."""
        return self._mask.copy()

    def get_keys_to_action(self) -> dict[tuple[int, ...], int]:
        """Return ``KEYS`` with key codes; ``gymnasium.utils.play`` calls this method."""
        stays = self._worlds.env.world.team.allow_stay
        return {(ord(key),): action for key, action in KEYS.items() if action < KEYS["s"] or stays}

    def render(self) -> np.ndarray | None:
        """Return the picture, uint8 [H * s, W * s, 3], in mode ``rgb_array``."""
        return self._screen.render()

    def _unpack(self, now: NumpyStep) -> tuple[Observation, dict[str, Any]]:
        self._mask = now.action_mask[0, 0].astype(bool)
        return now.of_agent(0, 0), now.info_of_agent(0, 0)


gym_env = FireExtinguishingEnv
"""The same, beside ``parallel_env``."""


def check_alone(worlds: NumpyWorlds, scenario: str) -> None:
    """Check that the team has one agent, as Gymnasium needs.

    Raises:
        ValueError: If there is more than one agent.
    """
    if worlds.env.n_agents != 1:
        raise ValueError(
            f"team.n_agents must be 1 for Gymnasium, got {worlds.env.n_agents} in {scenario}; "
            "warp_torchrl.api.adapters.parallel_env takes any team"
        )
