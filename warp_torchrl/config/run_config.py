"""The configuration of a run: every value checked, every component built, from plain values."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from functools import cached_property, partial
from typing import Any, Literal

import torch

from warp_torchrl import parallel
from warp_torchrl.algorithms.on_policy import OnPolicy
from warp_torchrl.collection.collectors import MultiProcess
from warp_torchrl.collection.imitation import Imitation
from warp_torchrl.config.checkpoint_config import CheckpointConfig
from warp_torchrl.config.construction import ConfigError, build, construct
from warp_torchrl.config.evaluation_config import EvaluationConfig
from warp_torchrl.config.levels import check_alike, level_worlds
from warp_torchrl.config.seeds import SEEDS, WORLDS
from warp_torchrl.curriculum import Curriculum
from warp_torchrl.env import LeveledEnv, WildfireEnv
from warp_torchrl.nearest import did_you_mean
from warp_torchrl.validation import check_fields
from warp_torchrl.world.fast.compile import check_compiler
from warp_torchrl.world.world import World

COMPONENTS = (
    "landscape",
    "wind",
    "fire",
    "team",
    "ignition",
    "sensing",
    "agencies",
    "observation",
    "reward",
    "model",
    "algorithm",
    "collector",
    "curriculum",
    "logger",
)
"""Groups whose options are classes."""
ENVIRONMENT = COMPONENTS[: COMPONENTS.index("reward") + 1]
"""Those that make an environment."""
WORLD_KEYS = (
    "scenario",
    "landscape",
    "wind",
    "fire",
    "team",
    "ignition",
    "sensing",
    "agencies",
    "steps_per_tick",
    "horizon",
    "cell_size",
    "action_masking",
)
"""What a scenario sets."""
COMMAND_KEYS = ("resume", "start_from", "debug", "policy", "overwrite", "maps", "maps_fires", "picture")
"""What the commands read themselves."""


@dataclass(frozen=True, kw_only=True)
class RunConfig:
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
        logger: The tracker, beside ``metrics.csv``.
        n_worlds: Worlds in the batch.
        total_frames: World steps in all; agent steps are frames x agents.
        seed: 0 to 2^31; no world of one is a world of another, or of an evaluation.
        device: ``cpu``, ``cuda`` or ``cuda:<number>``.
        processes: Processes that learn together, each from an equal share of the worlds; ``auto`` takes what
            ``parallel.automatic`` finds.
        graph: Record each step of the worlds, and each of the optimiser, as one CUDA graph.
        compile: Fuse steps and losses of training with ``torch.compile``: faster after a minute or two.
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
    logger: Any
    n_worlds: int = 256
    total_frames: int = 2_000_000
    seed: int = 0
    device: str = "cpu"
    processes: int | Literal["auto"] = "auto"
    compile: bool = False
    graph: bool = False
    checkpoint: CheckpointConfig = field(default_factory=CheckpointConfig)
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    imitation: Imitation = field(default_factory=Imitation)

    def __post_init__(self) -> None:
        check_fields(self)
        if not 1 <= self.n_worlds <= WORLDS:
            raise ValueError(f"n_worlds must be in 1..{WORLDS}, got {self.n_worlds}")
        if not 1 <= self.total_frames <= 10**15:
            raise ValueError(f"total_frames must be in 1..1e15, got {self.total_frames}")
        if not 0 <= self.seed <= SEEDS:
            raise ValueError(f"seed must be in 0..{SEEDS}, got {self.seed}")
        _check_device(self.device)
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

    def n_processes(self) -> int:
        """Return how many processes learn together."""
        if self.processes != "auto":
            return self.processes
        if isinstance(self.collector, MultiProcess) and not parallel.is_torchrun():
            return 1
        return parallel.automatic(self.n_worlds, torch.device(self.device))

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

    @cached_property
    def levels(self) -> list[World]:
        """Return the worlds of the curriculum's levels, easy to hard; the scenario's alone without one.

        Raises:
            ConfigError: If the curriculum names what is no key of the scenario, or a value breaks a rule.
        """
        return self.make_levels() if isinstance(self.curriculum, Curriculum) else [self.world]

    def make_env(self, n_worlds: int, seed: int, fuse: bool = False, graph: bool = False) -> WildfireEnv:
        """Return an environment of the run's scenario, on the run's device."""
        return WildfireEnv(
            self.world,
            observation=self.observation,
            reward=self.reward,
            n_worlds=n_worlds,
            seed=seed,
            device=self.device,
            fuse=fuse,
            graph=graph,
        )

    def make_training_env(self, n_worlds: int, seed: int) -> WildfireEnv:
        """Return an environment to learn from, of all levels, fused or recorded where that is asked for.

        The few episodes of an evaluation would take less time than their compilation.
        """
        if isinstance(self.curriculum, Curriculum):
            parts = {"observation": self.observation, "reward": self.reward, "device": self.device}
            return LeveledEnv(self.levels, n_worlds=n_worlds, seed=seed, **parts)
        return self.make_env(n_worlds, seed, fuse=self.compile, graph=self.graph)


def run_config(config: Mapping[str, Any]) -> RunConfig:
    """Check a composed configuration and build what it describes.

    Raises:
        ConfigError: With key, value and rule.
    """
    known = {each.name for each in fields(RunConfig)} | {*COMPONENTS, *WORLD_KEYS, *COMMAND_KEYS}
    for key in config:
        if key not in known:
            has = f"it has {', '.join(sorted(known - {'world', 'make_levels'}))}"
            raise ConfigError(f"{key} is not a key of the configuration; {has}{did_you_mean(key, known)}")
    for key in COMPONENTS:
        if key not in config:
            raise ConfigError(f"{key} must be given")
    built = build_components(config)
    parts = {"checkpoint": CheckpointConfig, "evaluation": EvaluationConfig, "imitation": Imitation}
    built |= {name: construct(kind, config.get(name, {}), name) for name, kind in parts.items()}
    built["make_levels"] = partial(level_worlds, config, built, WORLD_KEYS)
    values = _chosen(RunConfig, {**config, **built})
    _check_together(config)
    made = construct(RunConfig, values, "")
    with _in_section("algorithm"):
        made.algorithm.check_batch(made.n_worlds * made.collector.steps)
    with _in_section("model"):
        made.algorithm.check_model(made.model)
    with _in_section("collector"):
        made.collector.check_worlds(made.n_worlds)
    with _in_section("imitation"):
        made.imitation.check_fits(made.algorithm, made.collector, made.model)
    return made


@contextmanager
def _in_section(section: str) -> Iterator[None]:
    """Let a mistake name the section of the configuration that it is in."""
    try:
        yield
    except ValueError as error:
        raise ConfigError(f"{section}.{error}") from None


def build_components(config: Mapping[str, Any], names: Sequence[str] = COMPONENTS) -> dict[str, Any]:
    """Build components of a composed configuration, and the ``world`` of those that make one.

    Args:
        config: As plain values.
        names: Which; those of the world must be among them.

    Raises:
        ConfigError: With key, value and rule.
    """
    first = ("model",) if "model" in names else ()  # whose messages are the team's: mistakes are told of the model
    built = {name: build(config[name], name) for name in dict.fromkeys((*first, *names))}
    world = construct(World, _chosen(World, {**config, **built}), "")
    if "reward" in built:
        try:
            built["reward"].check_world(world)
        except ValueError as error:
            raise ConfigError(str(error)) from None
    return {**built, "world": world}


def _chosen(kind: type, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return those values that are fields of a dataclass."""
    return {each.name: values[each.name] for each in fields(kind) if each.name in values}


def _check_together(config: Mapping[str, Any]) -> None:
    reward, algorithm = config["reward"], config["algorithm"]
    model, radio = config["model"]["messages"], config["team"]["radio"]["carries"]
    if model in ("graph", "both") and radio not in ("graph", "both"):
        raise ConfigError(
            f"team.radio.carries must be graph or both where networks talk, model.messages={model}, got {radio}"
        )
    mixer, cooperation = algorithm.get("mixer", "none"), reward.get("cooperation", 1.0)
    if mixer != "none" and cooperation != 1.0:
        raise ConfigError(
            f"reward.cooperation must be 1 where the team has one value, algorithm.mixer={mixer}, got {cooperation}"
        )
    if reward["shaping"] > 0.0 and reward["gamma"] != algorithm["gamma"]:
        raise ConfigError(
            f"reward.gamma must be algorithm.gamma, {algorithm['gamma']}, for shaping to leave optimal policies as "
            f"they are, got {reward['gamma']}"
        )


def _check_device(name: str) -> None:
    try:
        device = torch.device(name)
    except RuntimeError:
        raise ValueError(f"device must be cpu, cuda or cuda:<number>, got {name}") from None
    if device.type not in ("cpu", "cuda"):
        raise ValueError(f"device must be cpu, cuda or cuda:<number>, got {name}")
    if device.type == "cuda" and (device.index or 0) >= torch.cuda.device_count():
        raise ValueError(f"device must be one of this machine's {torch.cuda.device_count()} CUDA devices, got {name}")
