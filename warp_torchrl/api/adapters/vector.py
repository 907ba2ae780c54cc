"""A batch of environments of one agent as a Gymnasium ``VectorEnv``."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from warp_torchrl.api.adapters.gymnasium import Observation, check_alone
from warp_torchrl.api.adapters.screen import FRAMES_PER_SECOND
from warp_torchrl.api.adapters.worlds import NumpyStep, NumpyWorlds, whole_number


class FireExtinguishingVectorEnv(VectorEnv[Observation, np.ndarray, np.ndarray]):
    """A batch of worlds with one agent each, stepped at once; also ``gymnasium.make_vec("Wildfire-v0", num_envs=B)``.

    Finished worlds are reset by Gymnasium's rules. ``AutoresetMode.NEXT_STEP``: the step that ends an episode returns
    its last observation; the next step ignores the world's action and returns the first observation of its next
    episode, with reward 0 and neither flag set. ``SAME_STEP``: the step that ends an episode returns the first
    observation of the next, and has the last observation and infos in ``final_obs`` and ``final_info``.

    Args:
        num_envs: B.
        scenario: One of ``conf/scenario``, with one agent.
        seed: World i draws with ``seed + i``; None draws a seed at the first reset, so that copies made before differ.
        render_mode: ``rgb_array`` or None.
        autoreset_mode: ``NEXT_STEP`` or ``SAME_STEP``, or its value, ``"SameStep"``.
        layout: ``dict``; or ``flat``, in every preset ``observation``, one float32 vector, beside ``action_mask``: the
            entries in the order of their names, bytes divided by 255.
        device: Device of the worlds; observations are numpy arrays.
        compile: Whether steps are compiled with ``torch.compile``: the first then takes half a minute, or some seconds
            once such an environment has been compiled on this machine.
        overrides: In the command line's grammar.
        more: Further overrides by name.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule; a ``TypeError`` too where a name is no key.
        ValueError: If ``num_envs`` is not positive, the team has more than one agent, a mode or the layout is unknown,
            or the seed is no whole number in 0..2**62.
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
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        layout: str = "dict",
        device: torch.device | str = "cpu",
        compile: bool = False,
        overrides: Sequence[str] = (),
        **more: object,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or rgb_array for a batch, got {render_mode!r}")
        mode = autoreset_mode.value if isinstance(autoreset_mode, AutoresetMode) else autoreset_mode
        if mode not in ("NextStep", "SameStep"):
            raise ValueError(f"autoreset_mode must be NextStep or SameStep, got {mode!r}")
        num_envs = whole_number("num_envs", num_envs)
        self._worlds = NumpyWorlds(
            scenario,
            n_worlds=num_envs,
            seed=seed,
            layout=layout,
            device=device,
            compile=compile,
            overrides=overrides,
            more=more,
        )
        check_alone(self._worlds, scenario)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.metadata = {**self.metadata, "autoreset_mode": AutoresetMode(mode)}
        self.single_observation_space = self._worlds.observation_space
        self.single_action_space = spaces.Discrete(self._worlds.n_actions)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start an episode in every world: episode 0 of given seeds, else the next one of each.

        Args:
            seed: World i draws with ``seed + i``, or with ``seed[i]``.
            options: Not used; ``reset_mask`` is an error, since finished worlds reset themselves.

        Returns:
            Batched observations, and infos: an array for each metric, and its mask ``_name``.

        Raises:
            ValueError: If a seed is no whole number in 0..2**62, or their number is not B.
        """
        if options is not None and "reset_mask" in options:
            raise ValueError("options['reset_mask'] must be left out: finished worlds start anew by themselves")
        now = self._worlds.reset(seed)
        super().reset(seed=None if seed is None or np.ndim(seed) else whole_number("seed", seed))
        return now.of_agent(slice(None), 0), self._info(now)

    def step(self, actions: np.ndarray) -> tuple[Observation, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Step every world; reset worlds that ended in this step or the last, by ``autoreset_mode``.

        Args:
            actions: Whole numbers, [B].

        Returns:
            Observations, rewards float64 [B], terminations bool [B], truncations bool [B], infos.

        Raises:
            RuntimeError: Before the first reset.
            ValueError: If actions are not whole numbers in range, one per world.
        """
        in_same_step, ended_before = self.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP, self._worlds.ended
        last = self._worlds.step(self._checked(actions)[:, None])
        ended = last.terminated | last.truncated if in_same_step else ended_before
        now = self._worlds.restart(ended, last.reward) if ended.any() else last
        how, info = (last, self._final(last, ended)) if in_same_step else (now, {})
        reward = now.reward[:, 0].astype(np.float64)
        return now.of_agent(slice(None), 0), reward, how.terminated, how.truncated, {**info, **self._info(now)}

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

    def _info(self, now: NumpyStep, where: np.ndarray | None = None) -> dict[str, Any]:
        """Return infos batched as Gymnasium does: 0 and false in worlds without one."""
        where = np.ones(self.num_envs, dtype=bool) if where is None else where
        values = {name: (value.T * where).T for name, value in now.info_of_agent(slice(None), 0).items()}
        return {**values, **{f"_{name}": where.copy() for name in values}}

    def _final(self, last: NumpyStep, ended: np.ndarray) -> dict[str, Any]:
        """Return the last observations and infos of the episodes that ended."""
        if not ended.any():
            return {}
        observations = np.full(self.num_envs, None, dtype=object)
        for world in ended.nonzero()[0].tolist():
            observations[world] = last.of_agent(world, 0)
        info = {"final_obs": observations, "final_info": self._info(last, ended)}
        return {**info, **{f"_{name}": ended.copy() for name in info}}
