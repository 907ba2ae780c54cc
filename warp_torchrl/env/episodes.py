"""Episodes of a batch of worlds: their seeds, their starts, and their saved state."""

import secrets
from abc import abstractmethod
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from typing import Any

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor
from torchrl.envs import EnvBase

from warp_torchrl.env.reset_cache import ResetCache, Start
from warp_torchrl.env.reset_pool import ResetPool
from warp_torchrl.system.modes import apart
from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.saved import filled
from warp_torchrl.world.state.state import TreeCounts, WorldState
from warp_torchrl.world.world import World


class Episodes(EnvBase):
    """An environment whose worlds have seeds and numbered episodes; subclasses define starts and observations."""

    world: World
    _worlds: tuple[WorldState, TreeCounts] | None  # and the counts of their trees
    _seeds: Tensor | None  # int64 [B]; None until they are drawn
    _episodes: Tensor  # number of each world's next episode, int64 [B]
    _episode_reward: Tensor  # float32 [B]
    _resets: ResetCache | ResetPool  # starts that lie ready

    @abstractmethod
    def _start(self, seeds: Tensor, episodes: Tensor) -> tuple[Start, Tensor]:
        """Return starts of seeds and episodes, and their faults: see ``World.start``."""

    @abstractmethod
    def _observe(self) -> TensorDict:
        """Return the tensordict of the worlds."""

    @property
    def seeds(self) -> Tensor:
        """Return each world's seed, int64 [B]; draw them now if none were given."""
        return self._drawn_seeds().clone()

    @apart
    def _drawn_seeds(self) -> Tensor:
        if self._seeds is None:
            first = 2**31 + secrets.randbelow(2**31)  # the seeds below are for training and evaluation
            self._seeds = torch.arange(first, first + self.batch_size[0], device=self.device)
        return self._seeds

    @property
    def world_state(self) -> WorldState:
        """Return the current worlds, a copy: to write to it changes nothing.

        Raises:
            RuntimeError: Before the first reset.
        """
        return self.shared_state.clone()

    @property
    def shared_state(self) -> WorldState:
        """Return the current worlds themselves, for those who read them at every step and never write.

        A reset of some worlds changes them in their place.

        Raises:
            RuntimeError: Before the first reset.
        """
        return self._current()[0]

    @property
    def tree_counts(self) -> TreeCounts:
        """Return the counts of the worlds' trees as they are now, by what became of them, a copy.

        Raises:
            RuntimeError: Before the first reset.
        """
        return self._current()[1].clone()

    def _current(self) -> tuple[WorldState, TreeCounts]:
        if self._worlds is None:
            raise RuntimeError("the environment has no state yet: call reset() first")
        return self._worlds

    @apart
    def set_seeds(self, seeds: Sequence[int], first_episode: int = 0) -> None:
        """Set the seed of each world from the next reset on.

        Args:
            seeds: One for each world, in 0..2^62.
            first_episode: Number of the next episode.

        Raises:
            ValueError: If the number of seeds is not B, or a seed is out of range.
        """
        if len(seeds) != self.batch_size[0]:
            raise ValueError(f"seeds must be {self.batch_size[0]} numbers, one a world, got {len(seeds)}")
        if not all(0 <= seed < 2**62 for seed in seeds):
            raise ValueError(f"seed must be in 0..2**62, got {min(seeds)}..{max(seeds)}")
        self._seeds = torch.tensor(list(seeds), dtype=torch.int64, device=self.device)
        self._episodes = torch.full_like(self._episodes, first_episode)
        self._resets.clear()

    @apart
    def set_state(self, state: WorldState) -> TensorDictBase:
        """Replace the worlds, and return their tensordict as a reset would.

        Raises:
            ValueError: If the batch, the map or the team differs from this environment's, or its radio's delay.
        """
        expected = (self.batch_size[0], *self.world.size, self.world.team.n_agents)
        got = (*state.cells.shape, state.vehicles.position.shape[1])
        if got != expected:
            raise ValueError(f"state must have [worlds, rows, columns, agents] {list(expected)}, got {list(got)}")
        self._enter(state.to(self.device).clone())
        self._episode_reward.zero_()
        return self._observe()

    def state_dict(self, *args: object, **kwargs: object) -> OrderedDict[str, Any]:
        """Return the environment's state: seeds, episodes, worlds and returns."""
        worlds = {} if self._worlds is None else self.shared_state.what_changes()
        return OrderedDict(  # as a module's is: TorchRL's EnvCreator looks into these alone
            seeds=self.seeds.clone(),
            episodes=self._episodes.clone(),
            episode_reward=self._episode_reward.clone(),
            worlds=OrderedDict((name, value.clone()) for name, value in worlds.items()),
        )

    @apart
    def load_state_dict(self, state_dict: Mapping[str, Any], strict: bool = True, **kwargs: object) -> None:
        """Restore what ``state_dict`` returned, all or nothing.

        Args:
            state_dict: Entries by name.
            strict: Whether all entries must be given; else missing ones keep their value. None at all changes nothing:
                so TorchRL's collectors keep an environment without transforms.

        Raises:
            ValueError: If an entry is missing or of another shape or type.
        """
        missing = [name for name in ("seeds", "episodes", "episode_reward", "worlds") if name not in state_dict]
        if missing and strict and state_dict:
            raise ValueError(f"state_dict must have {', '.join(missing)}, got {', '.join(state_dict)}")
        if missing:
            state_dict = {**self.state_dict(), **state_dict}
        state = self._restored(state_dict) if state_dict["worlds"] else None
        for name in ("seeds", "episodes", "episode_reward"):
            if state_dict[name].shape != self.batch_size:
                raise ValueError(f"{name} must have shape {list(self.batch_size)}, got {state_dict[name].shape}")
        self._seeds = state_dict["seeds"].to(self.device).clone()
        self._episodes = state_dict["episodes"].to(self.device).clone()
        self._episode_reward = state_dict["episode_reward"].to(self.device).clone()
        self._enter(state)
        self._resets.clear()

    def _restored(self, state_dict: Mapping[str, Any]) -> WorldState:
        """Return the worlds of a ``state_dict``."""
        like, *_ = self._sound_start(self._drawn_seeds(), self._episodes)
        return self.world.restored(filled(like, state_dict["worlds"]))

    @apart
    def _reset(self, tensordict: TensorDictBase | None = None, **kwargs: object) -> TensorDictBase:
        mask = None if tensordict is None else tensordict.get("_reset", None)
        mask = None if mask is None else mask.to(self.device)  # a transform may show the worlds on another device
        if isinstance(self._resets, ResetPool) and mask is not None and self._worlds is not None:
            self._resets.fill(self._drawn_seeds(), self._episodes)
            return self._masked_reset(self._resets, mask.flatten(), self._observe())
        if mask is None or self._worlds is None or mask.all():
            self._resets.clear()
            state, counts, seen = self._sound_start(self._drawn_seeds(), self._episodes)
            self._worlds = state, counts
            self._episodes = self._episodes + 1
            self._episode_reward = torch.zeros_like(self._episode_reward)
            return seen
        index = mask.flatten().nonzero()[:, 0]
        seen = self._start_again(index)
        rows = torch.zeros(len(mask), dtype=torch.int64, device=self.device).index_copy_(
            0, index, torch.arange(len(index), device=self.device)
        )
        return seen[rows]  # TorchRL reads those of the worlds that were reset

    @apart
    def maybe_reset(self, tensordict: TensorDictBase) -> TensorDictBase:
        """Reset the worlds that have ended; equal to TorchRL's, but it writes their rows only."""
        done = tensordict.get("done", None)
        if isinstance(self._resets, ResetPool) and done is not None:
            return self._masked_reset(self._resets, done.flatten(), tensordict)
        if done is None or done.all():
            return super().maybe_reset(tensordict)
        index = done.flatten().nonzero()[:, 0]
        if not len(index):
            return tensordict
        seen, out = self._start_again(index), tensordict.clone()
        started = dict(seen.items(include_nested=True, leaves_only=True))
        for key, value in out.items(include_nested=True, leaves_only=True):
            if key in started:
                value.index_copy_(0, index, started[key])
            elif isinstance(value, Tensor):
                value.index_fill_(0, index, 0)
        return out

    def _start_again(self, index: Tensor) -> TensorDict:
        """Start the next episode of some worlds, and return their tensordict."""
        if isinstance(self._resets, ResetPool):
            raise TypeError("worlds on a device that is not read start by a mask")
        state, counts = self._current()
        state[index], counts[index], seen = self._resets.pop(index, self._drawn_seeds(), self._episodes)
        self._episodes = self._episodes.index_add(0, index, torch.ones_like(index))
        self._episode_reward = self._episode_reward.index_fill(0, index, 0.0)
        return seen

    def _sound_start(self, seeds: Tensor, episodes: Tensor) -> Start:
        """Return starts of seeds and episodes, and raise if any is faulty."""
        start, faults = self._start(seeds, episodes)
        self.world.check(faults.tolist())
        return start

    def _masked_reset(self, pool: ResetPool, ended: Tensor, seen: TensorDictBase) -> TensorDictBase:
        """Start the next episode of the worlds that ended, bool [B], without asking which; return all worlds' rows."""
        now = *self._current(), seen
        (state, counts, out), started = pool.take(ended, now, self._drawn_seeds(), self._episodes)
        self._worlds = state, counts
        self._episodes = self._episodes + started
        self._episode_reward = self._episode_reward.masked_fill(started, 0.0)
        return out

    def _set_seed(self, seed: int | None) -> None:
        if seed is None:
            seed = int(torch.empty((), dtype=torch.int64).random_(2**31))
        self.set_seeds(range(seed, seed + self.batch_size[0]))

    def _enter(self, state: WorldState | None) -> None:
        """Replace the worlds and count their trees."""
        self._worlds = None if state is None else (state, count_trees(state))
