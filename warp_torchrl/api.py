"""What a user asks for by name: environments, the fire alone, trained policies."""

from collections.abc import Sequence
from pathlib import Path

import torch
from torch import Tensor
from torchrl.envs.utils import ExplorationType
from torchrl.modules import ProbabilisticActor

from warp_torchrl import checkpoint as checkpoints
from warp_torchrl.config import build_components, compose_config, plain, recompose
from warp_torchrl.construction import build
from warp_torchrl.env import WildfireEnv
from warp_torchrl.world.fire import Fire
from warp_torchrl.world.state import Cover
from warp_torchrl.world.wind import Wind, constant_wind
from warp_torchrl.world.world import burn


def make_env(
    scenario: str = "default",
    *,
    n_worlds: int = 64,
    device: torch.device | str = "cpu",
    seed: int = 0,
    seeds: Sequence[int] | None = None,
    overrides: Sequence[str] = (),
    validate: bool | None = None,
) -> WildfireEnv:
    """Make the environment of a scenario.

    Args:
        scenario: One of ``conf/scenario``.
        n_worlds: B.
        device: Where the worlds live.
        seed: World i draws with ``seed + i``.
        seeds: Seeds of the worlds one by one, in place of ``seed``.
        overrides: In the command line's grammar, ``["fire=paper", "team.n_agents=3"]``.
        validate: Check actions on CUDA too.

    Returns:
        A TorchRL ``EnvBase`` of batch size [B].

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
    """
    config = plain(compose_config("train", [f"scenario={scenario}", *overrides]))
    parts = build_components(config)
    return WildfireEnv(
        parts["world"],
        observation=parts["observation"],
        reward=parts["reward"],
        n_worlds=n_worlds if seeds is None else len(seeds),
        seed=seed,
        seeds=seeds,
        device=device,
        validate=validate,
    )


def simulate(
    cells: Tensor,
    cover: Tensor,
    elevation: Tensor | None = None,
    wind: tuple[float, float] | Wind = (0.0, 0.0),
    fire: str | Fire = "paper",
    ticks: int = 1,
    first_tick: int = 0,
    seed: int = 0,
    cell_size: float = 30.0,
) -> Tensor:
    """Run the fire alone, by the same code as the environment.

    Args:
        cells: The paper's codes, uint8 [B, H, W]: 0 empty, 1..10 tree age, 11..15 fire.
        cover: Land cover, uint8 [B, H, W]: 0 lake, 1 wetland, 2 grassland, 3 forest, 4 bare.
        elevation: float32 [B, H, W] [m]; None is flat.
        wind: (u east, v north) of the air's motion [m/s], or a wind component.
        fire: One of ``conf/fire``, ``paper`` being the complete automaton, or a ``Fire``.
        ticks: Fire ticks to run.
        first_tick: Counter of the first; a run cut in two goes on where it stopped.
        seed: World i draws with ``seed + i``.
        cell_size: Side of a cell [m].

    Returns:
        The codes after the ticks, uint8 [B, H, W].

    Raises:
        ValueError: If a shape, type, code or number does not fit.
    """
    for name, plane, top in (("cells", cells, 15), ("cover", cover, max(Cover))):
        if plane.dtype != torch.uint8 or plane.ndim != 3:
            raise ValueError(f"{name} must be uint8 [worlds, rows, columns], got {plane.dtype} {list(plane.shape)}")
        if plane.shape != cells.shape or plane.device != cells.device:
            raise ValueError(f"{name} must have the shape and device of cells, {list(cells.shape)} on {cells.device}")
        if plane.numel() and int(plane.max()) > top:
            raise ValueError(f"{name} must hold codes 0..{top}, got {int(plane.max())}")
    if elevation is not None and elevation.shape != cells.shape:
        raise ValueError(f"elevation must have the shape of cells, {list(cells.shape)}, got {list(elevation.shape)}")
    if elevation is not None and not bool(torch.isfinite(elevation).all()):
        raise ValueError("elevation must be finite everywhere")
    for name, number in (("ticks", ticks), ("first_tick", first_tick), ("seed", seed)):
        if number < 0:
            raise ValueError(f"{name} must be 0 or more, got {number}")
    automaton = (
        build(plain(compose_config("train", [f"fire={fire}"]))["fire"], "fire") if isinstance(fire, str) else fire
    )
    air = constant_wind(*wind) if isinstance(wind, tuple | list) else wind
    height = None if elevation is None else elevation.to(torch.float32)
    return burn(
        cells,
        cover,
        height,
        wind=air,
        fire=automaton,
        ticks=ticks,
        first_tick=first_tick,
        seed=seed,
        cell_size=cell_size,
    )


def load_policy(path: str | Path, mode: str = "best") -> ProbabilisticActor:
    """Load a trained policy: decentralised, observation and mask in, action out.

    Only the manifest, the configuration and the policy's parameters are read; all are verified first.

    Args:
        path: A run folder (its newest sound checkpoint), or one checkpoint folder.
        mode: ``sampled``, ``deterministic``, or ``best``: as was found on training seeds.

    Returns:
        A ``TensorDictModule``; any number of worlds. Its ``mode`` says how it acts outside of TorchRL's
        ``set_exploration_type``.

    Raises:
        CheckpointError: If there is no sound checkpoint, or it does not fit.
        ValueError: If the mode is unknown.
    """
    found, _ = checkpoints.newest(path)
    return policy_of(found, mode)


def policy_of(found: checkpoints.Checkpoint, mode: str = "best") -> ProbabilisticActor:
    """Return the policy of a verified checkpoint; see ``load_policy``."""
    if mode not in ("best", "sampled", "deterministic"):
        raise ValueError(f"mode must be best, sampled or deterministic, got {mode}")
    config = plain(recompose(found.record()))
    algorithm, model = build(config["algorithm"], "algorithm"), build(config["model"], "model")
    policy = algorithm.policy(found.manifest.signature, model)
    try:
        policy.load_state_dict(found.policy())
    except (RuntimeError, TypeError, AttributeError) as error:
        reason = " ".join(str(error).split())
        raise checkpoints.CheckpointError(f"{found.path} is of another architecture: {reason}") from None
    chosen = (found.manifest.mode or "sampled") if mode == "best" else mode
    policy[-1].default_interaction_type = (
        ExplorationType.RANDOM if chosen == "sampled" else ExplorationType.DETERMINISTIC
    )
    policy.mode = chosen
    return policy.requires_grad_(False).eval()
