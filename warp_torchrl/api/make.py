"""Environments by name."""

from collections.abc import Sequence
from typing import Any

import torch

from warp_torchrl.api.keywords import as_overrides, check_list
from warp_torchrl.env import WildfireEnv
from warp_torchrl.runs.config.components import build_components
from warp_torchrl.runs.config.construction import ENVIRONMENT
from warp_torchrl.runs.config.environment import compose_environment
from warp_torchrl.runs.config.grammar import listed_plugins
from warp_torchrl.runs.config.plugins import Plugin, load
from warp_torchrl.system.modes import apart


@apart
def make_env(
    scenario: str = "default",
    *,
    n_worlds: int = 64,
    device: torch.device | str = "cpu",
    seed: int | None = 0,
    seeds: Sequence[int] | None = None,
    overrides: Sequence[str] = (),
    plugins: Sequence[Plugin] = (),
    validate: bool | None = None,
    compile: bool = False,
    graph: bool = False,
    **keywords: Any,
) -> WildfireEnv:
    """Make the environment of a scenario.

    Args:
        scenario: One of ``conf/scenario``, or of a plug-in.
        n_worlds: B.
        device: Where the worlds live.
        seed: World i has seed ``seed + i``; None draws a seed on first use, so that copies differ.
        seeds: Seed of each world, instead of ``seed``.
        overrides: In the command line's grammar, ``["fire=paper", "team.n_agents=3"]``.
        plugins: Modules, or their names, of the user's own that register components; imported from the current folder
            too.
        validate: Check actions on CUDA too.
        compile: Compile the step with ``torch.compile``.
        graph: Record the step as one CUDA graph, where the device is cuda.
        keywords: More of the configuration by its keys: the name of an option, ``fire="paper"``, values,
            ``horizon=64`` or ``team=dict(n_agents=3)``, and components, ``landscape=Array(cover=cover)``: a landscape
            has the size of its array, whatever the scenario's.

    Returns:
        A TorchRL ``EnvBase`` of batch size [B].

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
        ImportError: If a library that a component needs is missing.
    """
    check_list("overrides", overrides)
    load([*plugins, *listed_plugins(overrides)])
    named = [each for each in overrides if not each.startswith("plugins=")]
    further, objects = as_overrides(keywords)
    config = {**compose_environment([f"scenario={scenario}", *named, *further]), **objects}
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
        graph=graph,
    )
