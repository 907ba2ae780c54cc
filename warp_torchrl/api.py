"""What a user asks for by name: environments and trained policies."""

import json
from collections.abc import Sequence
from pathlib import Path

import torch

from warp_torchrl.config.compose import compose_config, plain, recompose
from warp_torchrl.config.construction import build
from warp_torchrl.config.settings import ENVIRONMENT, build_components
from warp_torchrl.env import WildfireEnv
from warp_torchrl.policy import TrainedPolicy
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs import former
from warp_torchrl.runs.shipped import find_policy


def make_env(
    scenario: str = "default",
    *,
    n_worlds: int = 64,
    device: torch.device | str = "cpu",
    seed: int | None = 0,
    seeds: Sequence[int] | None = None,
    overrides: Sequence[str] = (),
    validate: bool | None = None,
    compile: bool = False,
) -> WildfireEnv:
    """Make the environment of a scenario.

    Args:
        scenario: One of ``conf/scenario``.
        n_worlds: B.
        device: Where the worlds live.
        seed: World i draws with ``seed + i``; None draws a seed when it is first needed, so that copies differ.
        seeds: Seeds of the worlds one by one, in place of ``seed``.
        overrides: In the command line's grammar, ``["fire=paper", "team.n_agents=3"]``.
        validate: Check actions on CUDA too.
        compile: Fuse what can be with ``torch.compile``.

    Returns:
        A TorchRL ``EnvBase`` of batch size [B].

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
    """
    config = plain(compose_config("train", [f"scenario={scenario}", *overrides]))
    parts = build_components(config, ENVIRONMENT)
    return WildfireEnv(
        parts["world"],
        observation=parts["observation"],
        reward=parts["reward"],
        n_worlds=n_worlds if seeds is None else len(seeds),
        seed=seed,
        seeds=seeds,
        device=device,
        validate=validate,
        fuse=compile,
    )


def load_policy(path: str | Path, mode: str = "best") -> TrainedPolicy:
    """Load a trained policy: decentralised, observation and mask in, action out.

    Only the manifest, the configuration and the policy's parameters are read; all are verified first.

    Args:
        path: A run folder (its newest sound checkpoint), one checkpoint folder, or the name of a policy that comes with
            the package: ``default``, ``single`` or ``skirmish``, where no folder has that name.
        mode: ``sampled``, ``deterministic``, or ``best``: as was found on training seeds.

    Returns:
        A ``TensorDictModule``; any number of worlds. Its ``mode`` says how it acts outside of TorchRL's
        ``set_exploration_type``; with its ``overrides`` any environment shows what it was trained to read.

    Raises:
        CheckpointError: If there is no sound checkpoint, or it does not fit.
        ValueError: If the mode is unknown.
    """
    found, _ = checkpoints.newest(find_policy(path))
    return policy_of(found, mode)


def policy_of(found: checkpoints.Checkpoint, mode: str = "best") -> TrainedPolicy:
    """Return the policy of a verified checkpoint; see ``load_policy``."""
    if mode not in ("best", "sampled", "deterministic"):
        raise ValueError(f"mode must be best, sampled or deterministic, got {mode}")
    record = found.record()
    config = plain(recompose(record))
    algorithm, model = build(config["algorithm"], "algorithm"), build(config["model"], "model")
    weights = found.policy()
    try:
        policy = algorithm.policy(found.manifest.signature, model)
        policy.load_state_dict(former.parameters(weights, policy.state_dict()))
    except Exception as error:  # whatever a signature or weights that do not fit make torch and TorchRL raise
        reason = " ".join(str(error).split())
        raise checkpoints.CheckpointError(f"{found.path} is of another architecture: {reason}") from None
    chosen = (found.manifest.mode or "sampled") if mode == "best" else mode
    seen = {name: value for name, value in config["observation"].items() if name != "_target_"}
    overrides = [f"observation={name}" for group, name in record.choices.items() if group == "observation"]
    overrides += [f"observation.{name}={json.dumps(value)}" for name, value in seen.items()]
    return TrainedPolicy(policy.requires_grad_(False).eval(), chosen, found.manifest.signature, overrides)
