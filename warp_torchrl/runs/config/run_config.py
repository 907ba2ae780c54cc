"""The configuration of a run: every value checked, every component built, from plain values."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import torch

from warp_torchrl.algorithms import parallel
from warp_torchrl.algorithms.on_policy import OnPolicy
from warp_torchrl.collection.collectors import MultiProcess
from warp_torchrl.collection.curriculum import Curriculum
from warp_torchrl.collection.imitation import Imitation
from warp_torchrl.collection.mixture import Mixture, worlds_by_share
from warp_torchrl.env import LeveledEnv, WildfireEnv
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.options import CheckpointConfig, EvaluationConfig
from warp_torchrl.runs.config.plugins import load
from warp_torchrl.runs.config.run_numbers import RunNumbers
from warp_torchrl.runs.config.seeds import first_world_seed
from warp_torchrl.runs.config.worlds import KindOfWorld, check_alike, check_kinds
from warp_torchrl.system.compiler import check_compiler
from warp_torchrl.world.world import World


@dataclass(frozen=True, kw_only=True)
class RunConfig(RunNumbers):
    """Everything that a run needs, checked: the components, built, and the run's own numbers.

    Attributes:
        scenario: Its name.
        world: The rules of the scenario.
        observation: What agents observe.
        reward: What they are paid for.
        model: The networks.
        algorithm: How they learn.
        collector: Where they collect.
        curriculum: Which levels of the scenario they play.
        make_levels: Returns the worlds of the levels, easy to hard, the scenario's last.
        mixture: Which kinds of worlds a training plays.
        make_kinds: Returns the kinds, built.
        logger: The tracker, beside ``metrics.csv``.
        checkpoint: When training saves.
        evaluation: How policies are evaluated.
        imitation: Whom a team learns from beside its rewards.

    Raises:
        ValueError: If a value is out of its range.
    """

    scenario: str
    world: World
    observation: Any
    reward: Any
    model: Any
    algorithm: Any
    collector: Any
    curriculum: Any
    make_levels: Any = field(compare=False)
    mixture: Any
    make_kinds: Any = field(compare=False)
    logger: Any
    checkpoint: CheckpointConfig = field(default_factory=CheckpointConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    imitation: Imitation = field(default_factory=Imitation)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.processes != "auto":
            self._check_shares(self.processes)

    def _check_shares(self, count: int) -> None:
        if not 1 <= count <= self.n_worlds or self.n_worlds % count:
            raise ValueError(f"processes must divide n_worlds, {self.n_worlds}, got {count}")
        if count > 1 and isinstance(self.collector, MultiProcess):
            raise ValueError(f"processes must be 1 where workers collect, got {count}: choose collector=direct")

    def _check_machine(self, count: int) -> None:
        device = torch.device(self.device)
        started = parallel.automatic(self.n_worlds, device)
        if parallel.is_torchrun() and count != started:
            raise ValueError(f"processes must be auto under torchrun, which has started {started}, got {count}")
        gpus = torch.cuda.device_count()
        if device.type == "cuda" and not parallel.is_torchrun() and count > gpus:
            raise ValueError(f"processes must be at most the {gpus} CUDA devices of this machine, got {count}")

    @property
    def first_seed(self) -> int:
        """Return the seed of the training's world 0; world i has that one + i."""
        return first_world_seed(self.seed, self.n_worlds)

    def n_processes(self) -> int:
        """Return how many processes learn together."""
        if self.processes != "auto":
            return self.processes
        if isinstance(self.collector, MultiProcess) and not parallel.is_torchrun():
            return 1
        return parallel.automatic(self.n_worlds, torch.device(self.device))

    def settled(self) -> Self:
        """Return the configuration with as many processes as ``auto`` takes now; it shares all that is built."""
        made = replace(self, processes=self.n_processes())
        vars(made).update({name: value for name, value in vars(self).items() if name in ("kinds", "levels")})
        return made

    def check_training(self) -> None:
        """Check what training asks of the machine, and playing what was trained does not.

        Raises:
            ConfigError: If ``compile`` is asked for where there is no compiler, or the processes are not as many as
                ``torchrun`` has started, or more than there are GPUs; or if ``graph`` is asked for where it cannot be.
        """
        try:
            self._check_machine(self.n_processes())
            self._check_shares(self.n_processes())
        except ValueError as error:
            raise ConfigError(str(error)) from None
        if isinstance(self.curriculum, Curriculum):
            self._check_curriculum(self.curriculum)
        if isinstance(self.mixture, Mixture):
            self._check_mixture()
        if self.graph:
            self._check_graph()
        if self.compile:
            try:
                check_compiler(torch.device(self.device))
            except ValueError as error:
                raise ConfigError(str(error)) from None

    def _check_graph(self) -> None:
        """Check that what is recorded stays as it is."""
        if torch.device(self.device).type != "cuda":
            raise ConfigError(f"graph must be false where device is not cuda, got device={self.device}")
        imitates = self.imitation.teacher is not None or self.imitation.demonstrations is not None
        if not isinstance(self.algorithm, OnPolicy) or imitates or self.model.memory:
            raise ConfigError(
                "graph must be false with a teacher or demonstrations, with memory, and where the algorithm replays"
            )
        if self.n_processes() > 1 or isinstance(self.collector, MultiProcess):
            raise ConfigError("graph must be false where several processes collect or learn")

    def _check_curriculum(self, curriculum: Curriculum) -> None:
        """Check that worlds of several rules can be played together, and by whom this training plays them."""
        if isinstance(self.collector, MultiProcess):
            raise ConfigError("curriculum must be none where workers collect: choose collector=direct")
        if self.imitation.teacher is not None:
            raise ConfigError("curriculum must be none with a teacher, who knows the rules of one level alone")
        for name in ("graph", "compile"):
            if getattr(self, name):
                raise ConfigError(f"{name} must be false with a curriculum, whose steps are of ever other sizes")
        check_alike(self.levels, curriculum, self.observation)

    def _check_mixture(self) -> None:
        """Check that several kinds of worlds can be played by this training, and who learns from them."""
        if isinstance(self.curriculum, Curriculum):
            raise ConfigError("mixture must be none with a curriculum, whose levels are of one scenario")
        if isinstance(self.collector, MultiProcess):
            raise ConfigError("mixture must be none where workers collect: choose collector=direct")
        if not isinstance(self.algorithm, OnPolicy):
            raise ConfigError("mixture must be none where the algorithm replays: choose mappo, ippo, ppo or a2c")
        if self.model.sharing == "none":
            raise ConfigError("mixture must be none where each agent has a network: choose model.sharing=team or role")
        if self.imitation.demonstrations is not None:
            raise ConfigError("mixture must be none with imitation.demonstrations, which are of one scenario")
        for name in ("graph", "compile"):
            if getattr(self, name):
                raise ConfigError(f"{name} must be false with a mixture, whose batches are of several shapes")
        self.worlds_of_kinds(self.n_worlds // self.n_processes())
        check_kinds(self.kinds, self.observation, self.reward)

    @cached_property
    def kinds(self) -> list[KindOfWorld]:
        """Return the kinds of worlds that a training plays: those of the mixture, or the scenario alone.

        Raises:
            ConfigError: If the mixture names what is no scenario, or a value breaks a rule.
        """
        if isinstance(self.mixture, Mixture):
            return self.make_kinds(self.mixture)
        return [KindOfWorld(name=self.scenario, world=self.world, teacher=self.imitation.teacher)]

    def worlds_of_kinds(self, count: int) -> list[int]:
        """Return how many of a process's worlds are of each kind.

        Raises:
            ConfigError: If there are fewer than kinds.
        """
        try:
            return worlds_by_share([kind.share for kind in self.kinds], count)
        except ValueError as error:
            raise ConfigError(str(error)) from None

    @cached_property
    def levels(self) -> list[World]:
        """Return the worlds of the curriculum's levels, easy to hard; the scenario's alone without one.

        Raises:
            ConfigError: If the curriculum names what is no key of the scenario, or a value breaks a rule.
        """
        return self.make_levels() if isinstance(self.curriculum, Curriculum) else [self.world]

    def make_env(
        self, n_worlds: int, seed: int, fuse: bool = False, graph: bool = False, world: World | None = None
    ) -> WildfireEnv:
        """Return an environment of the run's scenario, or of a world of its mixture, on the run's device.

        Where a collector's worker makes it, the plug-ins are imported there.
        """
        load(self.plugins)
        return WildfireEnv(
            self.world if world is None else world,
            observation=self.observation,
            reward=self.reward,
            n_worlds=n_worlds,
            seed=seed,
            device=self.device,
            fuse=fuse,
            graph=graph,
        )

    def make_training_env(self, n_worlds: int, seed: int, world: World | None = None) -> WildfireEnv:
        """Return an environment to learn from, of all levels or of a world of the mixture, fused or recorded where that
        is asked for.

        The few episodes of an evaluation would take less time than their compilation.
        """
        if isinstance(self.curriculum, Curriculum):
            parts = {"observation": self.observation, "reward": self.reward, "device": self.device}
            return LeveledEnv(self.levels, n_worlds=n_worlds, seed=seed, **parts)
        return self.make_env(n_worlds, seed, fuse=self.compile, graph=self.graph, world=world)
