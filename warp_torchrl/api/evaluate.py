"""Evaluations: ``evaluate``."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tensordict.nn import TensorDictModuleBase

from warp_torchrl.api.keywords import as_overrides, check_list
from warp_torchrl.evaluation.checks import check_maps, map_fires, picture_kind
from warp_torchrl.evaluation.evaluate import check_policy, evaluate_policy
from warp_torchrl.evaluation.result import Result
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.building import run_config
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.grammar import listed_plugins
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.plugins import Plugin, load
from warp_torchrl.runs.config.saved_config import restore, world_overrides
from warp_torchrl.runs.destination import check_free
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.runs.policies.trained import TrainedPolicy
from warp_torchrl.system.modes import apart
from warp_torchrl.training.run import Run, newest


@apart
def evaluate(
    policy: str | Path | Run | TensorDictModuleBase,
    scenario: str | None = None,
    *,
    overrides: Sequence[str] = (),
    folder: str | Path | None = None,
    picture: str | None = "gif",
    maps_fires: int | None = None,
    overwrite: bool = False,
    plugins: Sequence[Plugin] = (),
    **keywords: Any,
) -> Result:
    """Evaluate a policy beside the baselines on the same fires, with seeds that no training has.

    Args:
        policy: A baseline by its name; a run, its folder, a checkpoint, or a shipped policy's name; or a policy, such
            as ``load_policy`` returns, or any ``TensorDictModule`` that reads the team's observations and writes its
            actions, int64 [B, A].
        scenario: Name of the scenario; None takes that of the policy's training, of others ``skirmish``.
        overrides: In the command line's grammar, ``["evaluation.episodes=64", "team.n_agents=3"]``.
        folder: Where ``evaluation.json`` and the picture are written; None writes nothing.
        picture: As what the first fire is written: ``gif``, ``html``, ``mp4``, or None for no picture.
        maps_fires: Fires of maps of where one ground burns; None makes none.
        overwrite: Whether the folder may hold something.
        plugins: As for ``make_env``.
        keywords: As for ``make_env``: ``evaluation=dict(episodes=64)``, ``landscape=Array(cover=cover)``.

    Returns:
        The result: ``print`` shows it as a table.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
        CheckpointError: If the policy is not sound, or does not fit.
        OSError: If the folder cannot be written.
    """
    check_list("overrides", overrides)
    load([*plugins, *listed_plugins(overrides)])
    further, objects = as_overrides(keywords)
    chosen = [] if scenario is None else [f"scenario={scenario}"]
    composed, found = composed_evaluation(policy, [*chosen, *overrides, *further])
    values = {**plain(composed), **objects}
    fires = map_fires({"maps": maps_fires is not None, "maps_fires": 1000 if maps_fires is None else maps_fires})
    kind = picture_kind({"picture": picture})
    config = run_config(values)
    check_maps(config, fires)
    check_policy(config, found)
    path = None if folder is None else Path(folder)
    if path is not None and not overwrite:
        check_free(path, "folder")
    worlds = [*world_overrides({key: value for key, value in values.items() if key not in objects}), *map(str, objects)]
    return evaluate_policy(config, path, found, worlds, fires, kind)


def composed_evaluation(policy: Any, overrides: Sequence[str]) -> tuple[Any, Any]:
    """Return the configuration of an evaluation, composed, and what plays: a name, a checkpoint or a policy.

    Args:
        policy: As of ``evaluate``.
        overrides: In the command line's grammar, the scenario's among them.

    Raises:
        ConfigError: A ``ValueError``, with key, value and rule.
        CheckpointError: If the policy is not sound.
    """
    if isinstance(policy, Run):
        policy = policy.folder
    if isinstance(policy, TensorDictModuleBase):
        seen = policy.overrides if isinstance(policy, TrainedPolicy) else ()
        return compose_config("train", [*overrides, *seen]), policy
    if isinstance(policy, str) and policy in HEURISTICS:
        return compose_config("train", overrides), policy
    if not isinstance(policy, str | Path):
        raise ConfigError(f"policy must be a name, a folder, a run or a TensorDictModule, got {policy!r}")
    found = newest(find_policy(policy))
    return restore(found.saved_config(), overrides), found
