"""Evaluation of a policy beside the baselines on the same fires: table, ``evaluation.json``, a picture, maps."""

import logging
from collections.abc import Sequence
from pathlib import Path

from tensordict.nn import TensorDictModuleBase

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.metrics import metric_rows
from warp_torchrl.evaluation import cache
from warp_torchrl.evaluation.goal import goal
from warp_torchrl.evaluation.maps import maps_line, play_maps, write_maps
from warp_torchrl.evaluation.method import method
from warp_torchrl.evaluation.picture import PICTURE_KINDS, PictureKind, record_episode
from warp_torchrl.evaluation.play import Episodes, WithoutAgent, baselines_of, play, play_heuristics
from warp_torchrl.evaluation.report import evaluation_table, report, write_json
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.runs.config.run_config import RunConfig
from warp_torchrl.runs.config.saved_config import completed
from warp_torchrl.runs.policies.load import policy_of
from warp_torchrl.runs.policies.trained import MODES
from warp_torchrl.system import disk

log = logging.getLogger("warp_torchrl")


def evaluate_policy(
    run_config: RunConfig,
    folder: Path,
    found: checkpoints.Checkpoint | str,
    worlds: Sequence[str],
    map_fires: int | None = None,
    picture: PictureKind | None = "gif",
) -> None:
    """Evaluate a checkpoint or a heuristic beside the baselines: table, ``evaluation.json``, ``episode.gif``.

    Args:
        run_config: Configuration of the worlds and the evaluation.
        folder: The output folder.
        found: The checkpoint, or the heuristic's name.
        worlds: Overrides by which the worlds differ from their scenario.
        map_fires: Fires of the maps; None makes no maps.
        picture: As what the first fire is written, ``episode.<picture>``; None writes none.
    """
    first, folder = run_config.evaluation.first_seed, folder.resolve()
    env, one = run_config.make_env(run_config.evaluation.episodes, first), run_config.make_env(1, first)
    name, mode, actor, filmed = _actors(run_config, found, env, one)
    wanted = run_config.evaluation.baselines
    beside = baselines_of(run_config.world) if wanted is None else dict.fromkeys(wanted)
    others = _baselines(run_config, env, [each for each in beside if each != found])
    episodes = play(env, actor, first, mode, watch=True)
    learner, digest, frames, other_modes, left_out = None, "", None, {}, {}
    if isinstance(found, checkpoints.Checkpoint):
        learner, digest = method(completed(found.saved_config()))
        frames = found.manifest.frames
        other_modes = {f"trained, {other}": play(env, actor, first, other) for other in MODES if other != mode}
    if run_config.evaluation.leave_one_out:
        left_out = {
            agent: play(env, WithoutAgent(actor, index, env.world.team), first, mode)
            for index, agent in enumerate(env.agent_names)
        }
    content = report(
        run_config.scenario,
        name,
        first,
        episodes,
        others,
        other_modes=other_modes,
        left_out=left_out,
        method=learner,
        configuration=digest,
        world_overrides=worlds,
        frames=frames,
        goal=goal(run_config.world),
    )
    if map_fires is not None:
        log.info("playing %d fires on one ground for the maps, without the team and with it", map_fires)
    maps = None if map_fires is None else play_maps(run_config, lambda env: _actor(found, env, actor), mode, map_fires)
    if maps is not None:
        content["maps"] = maps.numbers()
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / "evaluation.json", content)
    print(evaluation_table(content, metric_rows(run_config.world)), flush=True)
    if maps is not None:
        print(maps_line(content["maps"]), flush=True)
        title = f"{run_config.scenario}: {maps.seeds[1]} fires on one ground, {maps.horizon} steps"
        write_maps(folder, maps, getattr(run_config.world.landscape, "grid", None), title, name)
    wrote = ["evaluation.json"]
    for kind in PICTURE_KINDS:  # a former evaluation's picture would show another policy
        (folder / f"episode.{kind}").unlink(missing_ok=True)
    if picture is not None:
        wrote += [f"episode.{picture}"]
        with disk.with_path(folder / wrote[-1]):
            record_episode(folder / wrote[-1], picture, one, filmed, f"{run_config.scenario}\n{name}", first, mode)
    wrote += [] if maps is None else ["maps"]
    log.info("wrote %s into %s", " and ".join(filter(None, (", ".join(wrote[:-1]), wrote[-1]))), folder)


def check_policy(run_config: RunConfig, found: checkpoints.Checkpoint | str) -> None:
    """Check that a checkpoint or a heuristic can be evaluated, before any output is written.

    Raises:
        CheckpointError: If the weights do not fit the networks.
        ConfigError: If the policy does not fit the environment.
    """
    one = run_config.make_env(1, run_config.evaluation.first_seed)
    _actors(run_config, found, one, one)


def _actors(
    run_config: RunConfig, found: checkpoints.Checkpoint | str, env: WildfireEnv, one: WildfireEnv
) -> tuple[str, str, TensorDictModuleBase, TensorDictModuleBase]:
    """Return the policy's name and mode, the policy for many worlds, and the policy for one."""
    if isinstance(found, str):
        return found, "sampled", HEURISTICS[found](env), HEURISTICS[found](one)
    try:
        policy = policy_of(found, run_config.evaluation.mode).to(run_config.device).fitted(env)
    except ValueError as error:
        raise ConfigError(f"the policy in {found.path} does not fit here: {error}") from None
    return f"trained, {policy.mode}", policy.mode, policy, policy


def _actor(
    found: checkpoints.Checkpoint | str, env: WildfireEnv, trained: TensorDictModuleBase
) -> TensorDictModuleBase:
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
