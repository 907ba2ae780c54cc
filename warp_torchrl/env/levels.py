"""Worlds of several rules in one batch: each episode is of one of several levels."""

from collections.abc import Mapping, Sequence
from typing import Any, Self

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.data import Categorical

from warp_torchrl.env.reset_cache import ResetCache, Start
from warp_torchrl.env.scene import Observations, Scene, Step
from warp_torchrl.env.wildfire import WildfireEnv
from warp_torchrl.system.modes import apart
from warp_torchrl.world.arrays.batch import Batch, concatenated
from warp_torchrl.world.arrays.random import Stream, uniform, world_key
from warp_torchrl.world.state.saved import filled
from warp_torchrl.world.state.state import ActionResult, Transition, TreeCounts, WorldState
from warp_torchrl.world.world import World

LEVEL = ("info", "level")
"""Key of the level of each world's episode, int64 [B, 1]."""


class LeveledEnv(WildfireEnv):
    """A batch in which each episode is of one of L levels, worlds of other rules but the same shapes.

    A world draws its level when its episode starts. The draw depends on its seed, the episode and the chances alone: a
    training draws the same in one process and in several, and there is no generator to save. A step is a step of the
    worlds of each level that is played.

    Args:
        levels: Their rules, easy to hard; the last is the target, whose rules ``world`` are.
        options: Of ``WildfireEnv``, but for ``fuse`` and ``graph``.
    """

    @apart
    def __init__(self, levels: Sequence[World], **options: Any) -> None:
        super().__init__(levels[-1], **options)
        self.levels = tuple(levels)
        self.level = torch.full(self.batch_size, len(levels) - 1, device=self.device)
        """The level of each world's episode, int64 [B]."""
        self._upto = torch.ones(len(levels), dtype=torch.float64, device=self.device)
        self.draw_by([0.0] * (len(levels) - 1) + [1.0])
        spec = self.observation_spec.clone()
        spec[LEVEL] = Categorical(len(levels), shape=(*self.batch_size, 1), dtype=torch.int64, device=self.device)
        self.observation_spec = spec

    def _no_resets(self) -> ResetCache:
        """Return a cache, on a GPU too: a step divides the worlds by their levels, and so waits anyway."""
        return ResetCache(self._sound_start)

    @apart
    def to(self, device: torch.device | str) -> Self:
        """Move the environment to a device, see ``WildfireEnv.to``; levels and chances move with it."""
        super().to(device)
        self.level, self._upto = self.level.to(self.device), self._upto.to(self.device)
        return self

    @apart
    def draw_by(self, chances: Sequence[float]) -> None:
        """Let episodes that start from now on draw their levels by these chances [L], which add up to 1."""
        upto = torch.tensor(chances, dtype=torch.float64, device=self.device).cumsum(0)
        upto = upto / upto[-1]
        if not torch.equal(upto, self._upto):
            self._upto = upto
            self._resets.clear()  # what lies ready was drawn by the former chances

    def drawn(self, seeds: Tensor, episodes: Tensor) -> Tensor:
        """Return the levels that episodes of seeds, int64 [n] each, draw now, int64 [n]."""
        draw = uniform(world_key(seeds, episodes), 0, Stream.LEVEL, (1,))[:, 0]
        return torch.searchsorted(self._upto, draw.double(), right=True)

    def state_dict(self, *args: object, **kwargs: object) -> Any:
        """Return the environment's state, and the level of each world."""
        state = super().state_dict(*args, **kwargs)
        state["level"] = self.level.clone()
        return state

    @apart
    def load_state_dict(self, state_dict: Mapping[str, Any], strict: bool = True, **kwargs: object) -> None:
        """Restore what ``state_dict`` returned, all or nothing.

        Raises:
            ValueError: If an entry is missing or of another shape or type.
        """
        if strict and state_dict and "level" not in state_dict:
            raise ValueError("state_dict must have level, which worlds without a curriculum have not")
        level = state_dict.get("level", self.level)
        if level.shape != self.batch_size or not ((level >= 0) & (level < len(self.levels))).all():
            raise ValueError(
                f"level must be {list(self.batch_size)} of 0..{len(self.levels) - 1}, got {level.tolist()}"
            )
        level = level.to(self.device).clone()
        super().load_state_dict({**state_dict, "level": level} if state_dict else {}, strict, **kwargs)
        self.level = level

    def _restored(self, state_dict: Mapping[str, Any]) -> WorldState:
        like, *_ = self._sound_start(self._drawn_seeds(), self._episodes)
        state = filled(like, state_dict["worlds"])
        return self._by_level(state_dict["level"], lambda scene, rows: scene.world.restored(state[rows]))

    @apart
    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: object) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        if mask is not None and self._worlds is not None and not mask.all():
            return super()._reset(tensordict, **kwargs)
        self._resets.clear()
        state, counts, seen = self._sound_start(self._drawn_seeds(), self._episodes)
        self._worlds, self.level = (state, counts), seen[LEVEL][:, 0].clone()
        self._episodes = self._episodes + 1
        self._episode_reward = torch.zeros_like(self._episode_reward)
        return seen

    def _start_again(self, index: Tensor) -> TensorDict:
        seen = super()._start_again(index)
        self.level = self.level.index_copy(0, index, seen[LEVEL][:, 0])
        return seen

    def _start(self, seeds: Tensor, episodes: Tensor) -> tuple[Start, Tensor]:
        level = self.drawn(seeds, episodes)

        def start(scene: Scene, rows: Tensor) -> tuple[WorldState, TreeCounts, Observations, Tensor]:
            state, counts, observed, faults = scene.start(seeds[rows], episodes[rows])
            return state, counts, observed, faults.expand(len(rows), -1)

        state, counts, observed, faults = self._by_level(level, start)
        seen = self._pack(state, observed, torch.zeros(len(seeds), device=self.device))
        return (state, counts, seen.set(LEVEL, level[:, None])), faults.any(dim=0)

    def _observe(self) -> TensorDict:
        def observe(scene: Scene, rows: Tensor) -> Observations:
            return scene.observe(state[rows], counts[rows])

        state, counts = self._current()
        seen = self._pack(state, self._by_level(self.level, observe), self._episode_reward)
        return seen.set(LEVEL, self.level[:, None].clone())

    def _acted(self, action: Tensor, critic: bool = True) -> dict[str, Any]:
        out = super()._acted(action, critic)
        out["info"]["level"] = self.level[:, None].clone()
        return out

    def _advance(self, before: WorldState, counts: TreeCounts, action: Tensor, critic: bool) -> Step:
        def step(scene: Scene, rows: Tensor) -> tuple[ActionResult, WorldState, TreeCounts, Observations, Tensor]:
            made, observed, reward = scene.step(before[rows], counts[rows], action[rows], critic)
            return made.result, made.after.replace(ground=None), made.counts_after, observed, reward

        result, after, counts_after, observed, reward = self._by_level(self.level, step)
        after = after.replace(ground=before.ground)  # which no step changes, and most of a state is
        made = Transition(before=before, result=result, after=after, counts_before=counts, counts_after=counts_after)
        return Step(made, observed, reward)

    def _by_level(self, level: Tensor, do: Any) -> Any:
        """Do something with the worlds of each level, and return the results in the order of the worlds.

        Args:
            level: Of each world, int64 [n].
            do: Called with the scene of a level and its worlds, int64 [m]; returns tensors [m, ...], batches of them,
                and tuples and dictionaries of both.
        """
        rows = [(level == at).nonzero()[:, 0] for at in range(len(self.levels))]
        played = [(world, its) for world, its in zip(self.levels, rows, strict=True) if len(its)]
        parts = [do(Scene(world, self.observation, self.reward_function), its) for world, its in played]
        if len(parts) == 1:
            return parts[0]
        return joined(parts, torch.cat([its for _, its in played]).argsort())


def joined(parts: Sequence[Any], order: Tensor) -> Any:
    """Return tensors, batches, None, or tuples and dictionaries of them, one after the other, in an order int64 [B]."""
    first = parts[0]
    if first is None:
        return None
    if isinstance(first, Tensor):
        return torch.cat(list(parts)).index_select(0, order)
    if isinstance(first, Batch):
        return concatenated(list(parts))[order]
    if isinstance(first, Mapping):
        return {name: joined([each[name] for each in parts], order) for name in first}
    several = [joined(list(each), order) for each in zip(*parts, strict=True)]
    return type(first)(*several) if hasattr(first, "_fields") else tuple(several)
