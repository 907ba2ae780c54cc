"""The TorchRL environment: connects world, observation, reward and metrics to ``EnvBase``."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Self

import torch
from tensordict import TensorDict, TensorDictBase
from torch import Tensor

from warp_torchrl.env.episodes import Episodes
from warp_torchrl.env.layout import checked_action, laid_out, packed
from warp_torchrl.env.observation import Observation, Surroundings, critic_state, searched_for
from warp_torchrl.env.pictures.render import render
from warp_torchrl.env.recorded import RecordedStep
from warp_torchrl.env.reset_cache import ResetCache, Start
from warp_torchrl.env.reset_pool import ResetPool
from warp_torchrl.env.reward import Efficiency, Reward
from warp_torchrl.env.scene import Observations, Scene, Step, why_not_compiled
from warp_torchrl.env.specs import make_specs
from warp_torchrl.system import memory
from warp_torchrl.system.device import needs_no_sync
from warp_torchrl.system.modes import apart
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import Transition, TreeCounts, WorldState
from warp_torchrl.world.world import World

_LEAST_BYTES = 16  # of a cell of a world with its start that lies ready; a step of `default` takes 40


class _Asked(NamedTuple):
    """How an environment was asked to compute its steps, see ``WildfireEnv``."""

    validate: bool | None
    fuse: bool
    graph: bool


class WildfireEnv(Episodes):
    """A batch of wildfires and the teams that fight them.

    World i draws with its own seed, ``seed + i`` or ``seeds[i]``: it evolves the same in any batch and at any place in
    it. The first reset is its episode 0, each later reset the next. A finished world stays as it is, with reward 0,
    until it is reset.

    Args:
        world: The scenario's rules.
        observation: What agents see.
        reward: What they earn.
        n_worlds: B.
        seed: Seed of world 0; None draws one when it is first needed, so that copies made before differ.
        seeds: Seeds of all worlds, in place of ``seed``.
        device: Where the worlds live.
        validate: Check on every device that actions are in range, which costs a synchronisation on CUDA; by default
            they are checked on the CPU only.
        fuse: Compile the step with ``torch.compile`` where that makes it faster, see ``why_not_compiled``; the first
            steps are then slow.
        graph: Record the step as one CUDA graph. World and observation must then stay as they are.

    Raises:
        ValueError: If ``n_worlds`` is not positive, ``seeds`` are not as many, a seed is out of range, the world lacks
            what the reward pays for, there is no C++ compiler to compile with, steps with advice are recorded, or
            the worlds cannot fit in memory.
    """

    batch_locked = True

    @apart
    def __init__(
        self,
        world: World | None = None,
        *,
        observation: Observation | None = None,
        reward: Reward | None = None,
        n_worlds: int = 1,
        seed: int | None = 0,
        seeds: Sequence[int] | None = None,
        device: torch.device | str = "cpu",
        validate: bool | None = None,
        fuse: bool = False,
        graph: bool = False,
    ) -> None:
        if n_worlds < 1:
            raise ValueError(f"n_worlds must be at least 1, got {n_worlds}")
        super().__init__(device=torch.device(device), batch_size=[n_worlds])
        self.world = World() if world is None else world
        self.observation = Surroundings() if observation is None else observation
        self.reward_function = Efficiency() if reward is None else reward
        self.reward_function.check_world(self.world)
        self._check_memory()
        if graph and (key := searched_for(self.observation)) is not None:
            raise ValueError(f"graph must be false with observation.{key}")
        self._asked = _Asked(validate, fuse, graph)
        self._settle()
        names, roles = self.world.team.agent_names, self.world.team.agent_roles
        self.agent_names, self.action_names = names, self.world.team.action_names
        self.role_names = self.world.team.role_names
        spaces = self.observation.spaces(self.world)
        self.channel_names = {name: space.names for name, space in spaces.items()}
        self.symmetries = {name: space.symmetry for name, space in spaces.items()}
        self.contents = {name: space.content for name, space in spaces.items()}
        shown = critic_state(self.observation, self.world)
        self.state_names, self.state_symmetry, self.state_content = shown.names, shown.symmetry, shown.content
        self.agency_names = self.world.agencies.names
        self.group_map = {"agents": list(names)}
        self.role_map = {role: [n for n, r in zip(names, roles) if r == role] for role in ROLES if role in roles}
        self._worlds: tuple[WorldState, TreeCounts] | None = None  # and the counts of their trees
        self.watcher: Callable[[Transition], None] | None = None
        """Called with the transition of every step, to measure behaviour."""
        self._episode_reward = torch.zeros(n_worlds, device=self.device)
        self._seeds: Tensor | None = None
        self._episodes = torch.zeros(n_worlds, dtype=torch.int64, device=self.device)
        if seeds is not None:
            self.set_seeds(seeds)
        elif seed is not None:
            self.set_seeds(range(seed, seed + n_worlds))
        specs = make_specs(self.world, self.observation, n_worlds, self.device)
        self.observation_spec, self.action_spec = specs.observation, specs.action
        self.reward_spec, self.done_spec = specs.reward, specs.done

    def _check_memory(self) -> None:
        """Refuse worlds that cannot fit in memory, before hours are spent on them."""
        (worlds,), (height, width) = self.batch_size, self.world.size
        wanted = _LEAST_BYTES * worlds * height * width
        there = torch.cuda.mem_get_info(self.device)[1] if self.device.type == "cuda" else memory.available()
        if wanted > there:
            raise ValueError(
                f"n_worlds must fit in memory: {worlds} of {height} x {width} cells need {wanted / 1e9:.1f} GB, "
                f"got {there / 1e9:.1f} GB: take fewer worlds or episodes, or a smaller map"
            )

    def _settle(self) -> None:
        """Set what depends on the device: how actions are checked, steps are computed, and starts are kept ready."""
        asked = self._asked
        self.validate = needs_no_sync(self.device) if asked.validate is None else asked.validate
        self.why_eager = (
            why_not_compiled(self.world, self.observation, self.device, self.batch_size[0]) if asked.fuse else None
        )
        """Why steps are not compiled where that was asked for; None where they are."""
        self._fuses = asked.fuse and self.why_eager is None
        self._recorded = RecordedStep(self._scene) if asked.graph else None
        self._resets = self._no_resets()

    def _no_resets(self) -> ResetCache | ResetPool:
        """Return where starts are kept ready, empty."""
        if needs_no_sync(self.device):
            return ResetCache(self._sound_start)
        return ResetPool(self._start, self.world.check)

    @apart
    def to(self, device: torch.device | str) -> Self:
        """Move the environment to a device, in the middle of its episodes too, and return it.

        Specs, seeds, episodes, worlds and returns move. What lies ready for resets is made anew there: it follows from
        the seeds and the episodes.
        """
        before = self.device
        super().to(device)
        if self.device == before:
            return self
        self.empty_cache()
        self._episodes, self._episode_reward = self._episodes.to(self.device), self._episode_reward.to(self.device)
        self._seeds = None if self._seeds is None else self._seeds.to(self.device)
        if self._worlds is not None:
            state, counts = self._worlds
            self._worlds = state.to(self.device), counts.to(self.device)
        self._settle()
        return self

    @property
    def n_agents(self) -> int:
        """Return A."""
        return self.world.team.n_agents

    @apart
    def render(self, scale: int = 12) -> Tensor:
        """Draw the worlds, uint8 [B, H * scale, W * scale, 3]."""
        return render(self.shared_state, self.world.team.table(self.device).flies, scale)

    def _start(self, seeds: Tensor, episodes: Tensor) -> tuple[Start, Tensor]:
        """Return starts of seeds and episodes, and their faults: see ``World.start``."""
        worlds, counts, observed, faults = self._scene.start(seeds, episodes)
        return (worlds, counts, self._pack(worlds, observed, torch.zeros(len(seeds), device=self.device))), faults

    @apart
    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        shape, limit = (*self.batch_size, self.n_agents), self.world.team.n_actions if self.validate else None
        action = checked_action(tensordict.get(("agents", "action"), None), shape, self.device, limit)
        return packed(self._acted(action))

    @apart
    def advance(self, action: Tensor) -> dict[str, Any]:
        """Let the agents act, and return what ``step`` does as ``next``, faster: in plain dictionaries, unchecked.

        The central critic's ``state`` is not made.

        Args:
            action: Valid actions, int64 [B, A].
        """
        return self._acted(action, critic=False)

    def _acted(self, action: Tensor, critic: bool = True) -> dict[str, Any]:
        transition, observed, reward = self._advance(*self._current(), action, critic)
        self._worlds = transition.after, transition.counts_after
        self._episode_reward = self._episode_reward + reward.mean(1)[:, 0]
        out = laid_out(self.world, transition.after, observed, self._episode_reward)
        if self.watcher is not None:
            self.watcher(transition)
        out["agents"]["reward"] = reward
        return out

    def _advance(self, before: WorldState, counts: TreeCounts, action: Tensor, critic: bool) -> Step:
        if self._recorded is None:
            return self._scene.step(before, counts, action, critic)
        if self._recorded.scene.reward is not self.reward_function:
            self._recorded = RecordedStep(self._scene)
        return self._recorded(before, counts, action)

    @property
    def _scene(self) -> Scene:
        """Return the current scene; users may assign another reward at any time."""
        return Scene(self.world, self.observation, self.reward_function, self._fuses)

    def _observe(self) -> TensorDict:
        """Return observations, mask, central state, flags and metrics of the worlds."""
        state, counts = self._current()
        return self._pack(state, self._scene.observe(state, counts), self._episode_reward)

    def _pack(self, state: WorldState, observed: Observations, episode_reward: Tensor) -> TensorDict:
        return packed(laid_out(self.world, state, observed, episode_reward))
