"""Trained policies by name."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import torch

from warp_torchrl.env.observation import OF_CRITIC
from warp_torchrl.models import RADIO
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import build
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.plugins import Plugin, load
from warp_torchrl.runs.config.saved_config import SavedConfig, restore
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.system.modes import apart


def load_policy(path: str | Path = "generalist", mode: str = "best", plugins: Sequence[Plugin] = ()) -> TrainedPolicy:
    """Load a trained decentralised policy, which reads observation and mask and writes the action.

    It reads only the manifest, the configuration and the policy's parameters, and verifies them first.

    Args:
        path: A run folder (its newest sound checkpoint), a checkpoint folder, or the name of a shipped policy, unless a
            folder has that name: ``generalist``, which plays every scenario in which a team sees the fire, or
            ``default``, ``single`` or ``skirmish``, each trained for the scenario of its name. Or ``hf://OWNER/NAME``,
            a repository of Hugging Face with an export as safetensors, see ``hub``.
        mode: ``sampled``, ``deterministic``, or ``best``: the better of the two on training seeds.
        plugins: Modules, or their names, of the user's own whose components the policy was trained with.

    Returns:
        A ``TensorDictModule`` for any number of worlds. It acts in its ``mode`` outside of TorchRL's
        ``set_exploration_type``; its ``overrides`` give an environment the observation that it was trained with.

    Raises:
        CheckpointError: If there is no sound checkpoint, or it does not fit.
        ConfigError: If it was trained with plug-ins that are not listed, or a library that reads it is not installed.
        ValueError: If the mode is unknown.
    """
    load(plugins)
    found, _ = checkpoints.newest(find_policy(path))
    return policy_of(found, mode)


@apart
def policy_of(
    found: checkpoints.Checkpoint, mode: str = "best", saved_config: SavedConfig | None = None
) -> TrainedPolicy:
    """Return the policy of a verified checkpoint, with its configuration or another one; see ``load_policy``."""
    if mode not in ("best", "sampled", "deterministic"):
        raise ValueError(f"mode must be best, sampled or deterministic, got {mode}")
    saved_config = found.saved_config() if saved_config is None else saved_config
    config = plain(restore(saved_config))
    algorithm, model = build(config["algorithm"], "algorithm"), build(config["model"], "model")
    weights = found.policy()
    try:
        with torch.device("meta"):  # without memory: a configuration may name networks larger than the machine
            shapes = _shapes(algorithm.policy(found.manifest.signature, model).state_dict())
        if shapes != _shapes(weights):
            raise ValueError("the parameters have other names or shapes than the networks that it is said to have")
        policy = algorithm.policy(found.manifest.signature, model)
        policy.load_state_dict(weights)
    except Exception as error:  # torch and TorchRL raise many types for weights that do not fit
        reason = " ".join(str(error).split())
        raise checkpoints.CheckpointError(f"{found.path} is of another architecture: {reason}") from None
    chosen = (found.manifest.mode or "sampled") if mode == "best" else mode
    seen = {name: value for name, value in config["observation"].items() if name not in ("_target_", *OF_CRITIC)}
    overrides = [f"observation={name}" for group, name in saved_config.choices.items() if group == "observation"]
    overrides += [f"observation.{name}={json.dumps(value)}" for name, value in seen.items()]
    overrides += (
        [f"mechanics.radio.carries={saved_config.values['mechanics']['radio']['carries']}"]
        if RADIO in policy.in_keys
        else []
    )
    return TrainedPolicy(policy.requires_grad_(False).eval(), chosen, found.manifest.signature, overrides)


def _shapes(parameters: Mapping[str, torch.Tensor]) -> dict[str, torch.Size]:
    return {name: value.shape for name, value in parameters.items()}
