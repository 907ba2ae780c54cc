"""Evaluation of a policy beside the baselines on the same fires: table, ``evaluation.json``, a picture, maps."""

import logging
from collections.abc import Sequence
from pathlib import Path
from typing import TypeAlias

from tensordict.nn import TensorDictModuleBase

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.metrics import metric_rows
from warp_torchrl.evaluation import cache
from warp_torchrl.evaluation.goal import goal
from warp_torchrl.evaluation.maps import PolicyMaps, play_maps, write_maps
from warp_torchrl.evaluation.method import method
from warp_torchrl.evaluation.picture import PICTURE_KINDS, PictureKind, record_episode
from warp_torchrl.evaluation.play import Episodes, WithoutAgent, baselines_of, play, play_heuristics
from warp_torchrl.evaluation.report import write_json
from warp_torchrl.evaluation.result import Result
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import completed
from warp_torchrl.runs.history import history_line
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.runs.policies.trained import MODES, TrainedPolicy
from warp_torchrl.system import disk

log = logging.getLogger("warp_torchrl")


Policy: TypeAlias = checkpoints.Checkpoint | TensorDictModuleBase | str
"""What is evaluated: a checkpoint, a policy of one's own, or a heuristic by its name."""


def evaluate_policy(
    run_config: RunConfig,
    folder: Path | None,
    found: Policy,
    worlds: Sequence[str],
    map_fires: int | None = None,
    picture: PictureKind | None = "gif",
) -> Result:
    """Evaluate a policy beside the baselines; write ``evaluation.json``, a picture and maps.

    Args:
        run_config: Configuration of the worlds and the evaluation.
        folder: The output folder; None writes nothing.
        found: The policy.
        worlds: Overrides by which the worlds differ from their scenario.
        map_fires: Fires of the maps; None makes no maps.
        picture: As what the first fire is written, ``episode.<picture>``; None writes none.
    """
    first = run_config.evaluation.first_seed
    env, one = run_config.make_env(run_config.evaluation.episodes, first), run_config.make_env(1, first)
    name, mode, actor, filmed = _actors(run_config, found, env, one)
    wanted = run_config.evaluation.baselines
    beside = baselines_of(run_config.world) if wanted is None else dict.fromkeys(wanted)
    others = _baselines(run_config, env, [each for each in beside if each != name])
    episodes = play(env, actor, first, mode, watch=True)
    learner, digest, frames, trained, other_modes = None, "", None, "", {}
    if isinstance(found, checkpoints.Checkpoint):
        learner, digest = method(completed(found.saved_config()))
        frames, trained = found.manifest.frames, history_line(found.history)
        other_modes = {f"trained, {other}": play(env, actor, first, other) for other in MODES if other != mode}
    left_out = _without_each(env, actor, first, mode) if run_config.evaluation.leave_one_out else {}
    if map_fires is not None:
        log.info("playing %d fires on one ground for the maps, without the team and with it", map_fires)
    maps = None if map_fires is None else play_maps(run_config, lambda env: _actor(found, env, actor), mode, map_fires)
    folder = None if folder is None else folder.resolve()
    wrote = ["evaluation.json", *([f"episode.{picture}"] if picture else []), *([] if maps is None else ["maps"])]
    result = Result(
        scenario=run_config.scenario,
        policy=name,
        first_seed=first,
        episodes=episodes,
        baselines=others,
        other_modes=other_modes,
        left_out=left_out,
        method=learner,
        configuration=digest,
        world_overrides=worlds,
        frames=frames,
        trained=trained,
        goal=goal(run_config.world),
        maps=None if maps is None else maps.numbers(),
        rows=metric_rows(run_config.world),
        folder=folder,
        wrote=() if folder is None else tuple(wrote),
    )
    if folder is not None:
        _write(result, folder, run_config, maps)
        _write_picture(folder, picture, one, filmed, f"{run_config.scenario}\n{name}", first, mode)
    return result


def _without_each(env: WildfireEnv, actor: TensorDictModuleBase, first: int, mode: str) -> dict[str, Episodes]:
    """Return the episodes of the team without each agent, by its name."""
    agents = enumerate(env.agent_names)
    return {agent: play(env, WithoutAgent(actor, index, env.world.team), first, mode) for index, agent in agents}


def _write(result: Result, folder: Path, run_config: RunConfig, maps: PolicyMaps | None) -> None:
    """Write ``evaluation.json`` and the maps."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "evaluation.json", result.report)
    if maps is not None:
        title = f"{run_config.scenario}: {maps.seeds[1]} fires on one ground, {maps.horizon} steps"
        write_maps(folder, maps, getattr(run_config.world.landscape, "grid", None), title, result.policy)


def _write_picture(
    folder: Path,
    kind: PictureKind | None,
    env: WildfireEnv,
    policy: TensorDictModuleBase,
    title: str,
    seed: int,
    mode: str,
) -> None:
    """Write the first fire as a picture; one that an earlier evaluation left would show another policy."""
    for each in PICTURE_KINDS:
        (folder / f"episode.{each}").unlink(missing_ok=True)
    if kind is not None:
        path = folder / f"episode.{kind}"
        with disk.with_path(path):
            record_episode(path, kind, env, policy, title, seed, mode)


def announce(result: Result) -> None:
    """Print a result that was written, and log where it is."""
    print(result, flush=True)
    wrote = result.wrote
    log.info("wrote %s into %s", " and ".join(filter(None, (", ".join(wrote[:-1]), wrote[-1]))), result.folder)


def check_policy(run_config: RunConfig, found: Policy) -> None:
    """Check that a policy can be evaluated, before any output is written.

    Raises:
        CheckpointError: If the weights do not fit the networks.
        ConfigError: If the policy does not fit the environment.
    """
    one = run_config.make_env(1, run_config.evaluation.first_seed)
    _actors(run_config, found, one, one)


def _actors(
    run_config: RunConfig, found: Policy, env: WildfireEnv, one: WildfireEnv
) -> tuple[str, str, TensorDictModuleBase, TensorDictModuleBase]:
    """Return the policy's name and mode, the policy for many worlds, and the policy for one."""
    if isinstance(found, str):
        return found, "sampled", HEURISTICS[found](env), HEURISTICS[found](one)
    if isinstance(found, TensorDictModuleBase) and not isinstance(found, TrainedPolicy):
        return type(found).__name__, "sampled", found, found
    mode, place = run_config.evaluation.mode, f" in {found.path}" if isinstance(found, checkpoints.Checkpoint) else ""
    try:
        trained = found if isinstance(found, TrainedPolicy) else policy_of(found, mode)
        policy = trained.to(run_config.device).fitted(env)
    except ValueError as error:
        raise ConfigError(f"the policy{place} does not fit here: {error}") from None
    return f"trained, {policy.mode}", policy.mode, policy, policy


def _actor(found: Policy, env: WildfireEnv, trained: TensorDictModuleBase) -> TensorDictModuleBase:
    """Return the policy for an environment: a heuristic reads one, a trained policy takes any."""
    return HEURISTICS[found](env) if isinstance(found, str) else trained


_PLAYED: dict[str, tuple[RunConfig, dict[str, Episodes]]] = {}


def _baselines(run_config: RunConfig, env: WildfireEnv, names: Sequence[str]) -> dict[str, Episodes]:
    """Return the episodes of heuristics; jobs of a sweep with the same worlds play them once, and so do later ones."""
    worlds = repr(
        (run_config.world, run_config.observation, run_config.reward, run_config.evaluation, run_config.device)
    )
    # It keeps the configuration alive: a repr may hold addresses of objects.
    _, played = _PLAYED.setdefault(worlds, (run_config, {}))
    played |= cache.cached(run_config, [name for name in names if name not in played])
    new = play_heuristics(env, run_config.evaluation.first_seed, [name for name in names if name not in played])
    cache.store(run_config, new)
    played |= new
    return {name: played[name] for name in names}
