"""The numpy interface of a ``WildfireEnv``, shared by all adapters."""

import json
import operator
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from gymnasium import spaces
from tensordict import TensorDictBase

from warp_torchrl.api.make import make_env
from warp_torchrl.env.flat import FLAT, flattened
from warp_torchrl.env.layout import packed
from warp_torchrl.env.observation import critic_state
from warp_torchrl.runs.config.construction import ConfigError, UnknownKeyError

LAYOUTS = ("dict", "flat")
"""An agent's observation as a dict of its entries, or as one vector and the mask."""


class NumpyStep(NamedTuple):
    """The numpy results of a reset or a step, for B worlds of A agents."""

    observation: dict[str, np.ndarray]  # [B, A, ...] each; "" where the observation is one array
    action_mask: np.ndarray  # int8 [B, A, actions]
    reward: np.ndarray  # float32 [B, A], zeros after a reset
    terminated: np.ndarray  # bool [B]
    truncated: np.ndarray  # bool [B]
    info: dict[str, np.ndarray]  # float64 [B] each
    radio: np.ndarray | None  # float32 [B, A, A, 3], ``Hearing.observed``; None where agents do not talk
    sent: np.ndarray | None  # float32 [B, A, n], what each observed when it sent what comes late, flat; else None
    layout: str

    def of_agent(self, world: int | slice, agent: int) -> np.ndarray | dict[str, np.ndarray]:
        """Return one agent's observation in its observation space."""
        entries = {name: value[world, agent] for name, value in self.observation.items()}
        mask = self.action_mask[world, agent]
        if self.layout == "flat":
            return {FLAT: flattened(entries, n_batch=mask.ndim - 1), "action_mask": mask}
        return entries.get("", {**entries, "action_mask": mask})

    def info_of_agent(self, world: int | slice, agent: int) -> dict[str, np.ndarray]:
        """Return the world's metrics, the agent's radio if it talks, and its mask if its observation has none.

        Where messages arrive late, ``sent`` is the agent's observation when it sent what arrives now. TorchRL's
        ``PettingZooWrapper`` fails if both have the mask.
        """
        info = {name: value[world] for name, value in self.info.items()}
        radio = {"radio": self.radio, "sent": self.sent}
        info |= {name: value[world, agent] for name, value in radio.items() if value is not None}
        has_mask = self.layout == "flat" or "" not in self.observation
        return info if has_mask else {**info, "action_mask": self.action_mask[world, agent]}


class UnknownKeywordError(ConfigError, TypeError):
    """A keyword that is neither an argument nor a configuration key; a ``TypeError``, as of any function."""


class NumpyWorlds:
    """An environment from ``make_env`` with numpy inputs and outputs.

    Args:
        scenario: One of ``conf/scenario``.
        n_worlds: B.
        seed: World i draws with ``seed + i``; None draws a seed at the first reset, so that copies made before differ.
        layout: ``dict`` or ``flat``.
        device: Where the worlds live.
        compile: Whether steps are compiled.
        overrides: In the command line's grammar.
        more: Further overrides by name.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule; a ``TypeError`` too where a name is no key.
        ValueError: If the seed is not a whole number in 0..2**62, or the layout is unknown.
    """

    def __init__(
        self,
        scenario: str,
        *,
        n_worlds: int,
        seed: int | None,
        layout: str,
        device: torch.device | str,
        compile: bool,
        overrides: Sequence[str],
        more: Mapping[str, object],
    ) -> None:
        if layout not in LAYOUTS:
            raise ValueError(f"layout must be {' or '.join(LAYOUTS)}, got {layout!r}")
        self._layout = layout
        named = [f"{name}={as_override(name, value)}" for name, value in more.items()]
        first = None if seed is None else whole_number("seed", seed)
        try:
            self.env = make_env(
                scenario,
                n_worlds=n_worlds,
                device=device,
                seed=first,
                overrides=[*overrides, *named],
                validate=False,
                compile=compile,
            )
        except UnknownKeyError as error:
            if error.key not in more:
                raise
            raise UnknownKeywordError(f"got an unexpected keyword argument {error.key!r}: {error}") from None
        self._now: TensorDictBase | dict[str, Any] | None = None

    @property
    def observation_space(self) -> spaces.Box | spaces.Dict:
        """Return one agent's observation space: a Box in preset ``paper``, else a flat Dict with the mask.

        In layout ``flat`` it is a Dict of one Box and the mask in every preset.
        """
        bounds = {name: space.bounds() for name, space in self.env.observation.spaces(self.env.world).items()}
        ends = [{name: bound[end].numpy() for name, bound in bounds.items()} for end in (0, 1)]
        if self._layout == "flat":
            ends = [{FLAT: flattened(end)} for end in ends]
        low, high = ends
        boxes = {name: spaces.Box(low[name], high[name], dtype=low[name].dtype.type) for name in low}
        mask = spaces.Box(0, 1, (self.n_actions,), np.int8)
        return boxes[""] if "" in boxes else spaces.Dict({**boxes, "action_mask": mask})

    @property
    def state_space(self) -> spaces.Box:
        """Return the space of a world's central state."""
        space = self.env.full_observation_spec_unbatched["state"].space
        return spaces.Box(space.low.numpy(force=True), space.high.numpy(force=True))

    @property
    def n_actions(self) -> int:
        """Return how many actions an agent has."""
        return self.env.world.team.n_actions

    @property
    def now(self) -> TensorDictBase | dict[str, Any]:
        """Return the environment's last output, of ``reset`` or of ``advance``.

        Raises:
            RuntimeError: Before the first reset.
        """
        if self._now is None:
            raise RuntimeError("the environment has no state yet: call reset() first")
        return self._now

    @property
    def ended(self) -> np.ndarray:
        """Return which worlds have ended, bool [B].

        Raises:
            RuntimeError: Before the first reset.
        """
        return self.now["done"][:, 0].numpy(force=True)

    def reset(self, seed: int | Sequence[int] | None = None) -> NumpyStep:
        """Start episode 0 of given seeds, ``seed + i`` in world i, or without a seed each world's next episode.

        Raises:
            ValueError: If a seed is not a whole number in 0..2**62, or their number is not B.
        """
        n_worlds = self.env.batch_size[0]
        if isinstance(seed, (list, tuple, np.ndarray)):
            self.env.set_seeds([whole_number("seed", each) for each in seed])
        elif seed is not None:
            first = whole_number("seed", seed)
            self.env.set_seeds(range(first, first + n_worlds))
        self._now = self.env.reset()
        return self._to_numpy(np.zeros((n_worlds, self.env.n_agents), np.float32))

    def step(self, action: np.ndarray) -> NumpyStep:
        """Advance every world by one step; a finished one does not change, with reward 0.

        Args:
            action: Valid actions, int64 [B, A].
        """
        self._now = now = self.env.advance(torch.from_numpy(action).to(self.env.device))
        return self._to_numpy(now["agents"]["reward"][..., 0].numpy(force=True))

    def restart(self, which: np.ndarray, reward: np.ndarray) -> NumpyStep:
        """Start the next episode in some worlds.

        Args:
            which: bool [B].
            reward: Rewards of the last step, float32 [B, A].
        """
        asked = torch.from_numpy(which).to(self.env.device)[:, None]
        now = packed(self.now) if isinstance(self.now, dict) else self.now
        self._now = self.env.reset(now.exclude(("agents", "reward")).set("_reset", asked))
        return self._to_numpy(reward)

    def state(self) -> np.ndarray:
        """Return the central state, float32 [B, C, 16, 16]."""
        worlds = self.env.shared_state
        shown = critic_state(self.env.observation, self.env.world)
        return shown(worlds, self.env.world.forecast(worlds)).numpy(force=True)

    def frames(self) -> np.ndarray:
        """Return a frame of each world, uint8 [B, H * s, W * s, 3]."""
        return self.env.render().numpy(force=True)

    def picture(self) -> np.ndarray:
        """Return a frame of world 0, uint8 [H * s, W * s, 3]."""
        return self.frames()[0]

    def _to_numpy(self, reward: np.ndarray) -> NumpyStep:
        agents, info = self.now["agents"], self.now["info"]
        rows = torch.cat(list(info.values()), dim=-1).to(torch.float64).T.numpy(force=True)
        return NumpyStep(
            observation=_named(agents["observation"]),
            action_mask=agents["action_mask"].to(torch.int8).numpy(force=True),
            reward=reward,
            terminated=self.now["terminated"][:, 0].numpy(force=True),
            truncated=self.now["truncated"][:, 0].numpy(force=True),
            info=dict(zip(info.keys(), rows)),
            radio=agents["radio"].numpy(force=True) if "radio" in agents.keys() else None,
            sent=flattened(_named(agents["sent"]), n_batch=2) if "sent" in agents.keys() else None,
            layout=self._layout,
        )


def _named(entries: torch.Tensor | TensorDictBase) -> dict[str, np.ndarray]:
    """Return entries by name, [B, A, ...] each; "" where they are one tensor."""
    named = {"": entries} if isinstance(entries, torch.Tensor) else dict(entries.items())
    return {name: value.numpy(force=True) for name, value in named.items()}


def action_number(name: str, action: object, n_actions: int) -> int:
    """Return an action, or the only one in an array [1], as an ``int``.

    Raises:
        ValueError: If it is not a whole number or out of range.
    """
    number = whole_number(name, action[0] if isinstance(action, np.ndarray) and action.shape == (1,) else action)
    if not 0 <= number < n_actions:
        raise ValueError(f"{name} must be in 0..{n_actions - 1}, got {number}")
    return number


def whole_number(name: str, value: Any) -> int:
    """Return a whole number of Python, numpy or torch as an ``int``.

    Raises:
        ValueError: If the value is not a whole number; a ``bool`` is not.
    """
    try:
        if isinstance(value, bool):
            raise TypeError
        return operator.index(value)
    except TypeError:
        given = " ".join(repr(value).split())
        raise ValueError(f"{name} must be a whole number, got {given} ({type(value).__name__})") from None


def as_override(name: str, value: object) -> str:
    """Return an override's value in the command line's grammar.

    Raises:
        ValueError: If it is not a text, a number, true, false, none or a list of those.
    """
    try:
        text = value if isinstance(value, str) else json.dumps(value)
    except (TypeError, ValueError):
        text = None
    if text is None or isinstance(value, dict):
        raise ValueError(f"{name} must be a text, a number or a list, got {type(value).__name__}")
    return text
