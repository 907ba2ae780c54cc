"""One policy on every kind of fire, beside the best baseline of each, or a policy trained on that kind only."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch

from warp_torchrl.api.make import make_env
from warp_torchrl.benchmark.tasks import FIRST_SEED, SCENARIOS, difference_cell, interval_cell
from warp_torchrl.env import WildfireEnv
from warp_torchrl.evaluation.play import play, play_heuristics
from warp_torchrl.evaluation.statistics import compare, summarise
from warp_torchrl.runs.policies.load import load_policy
from warp_torchrl.runs.policies.trained import TrainedPolicy


class ScenarioVariant(NamedTuple):
    """A scenario with its overrides, on which a policy plays.

    Attributes:
        name: Of its row.
        scenario: One of ``conf/scenario``.
        overrides: In the command line's grammar.
        rival: Name of a shipped policy that is played beside it; None takes the best baseline.
    """

    name: str
    scenario: str
    overrides: tuple[str, ...] = ()
    rival: str | None = None


OURS = tuple(ScenarioVariant(name, name) for name in SCENARIOS if not name.startswith("paper"))
SPREAD = tuple(ScenarioVariant(f"spread_{each.name}", f"spread_{each.name}") for each in OURS if each.name != "hazard")
TEAMS = tuple(
    ScenarioVariant(f"default, {n} vehicles", "default", (f"team.n_agents={n}",)) for n in (1, 2, 3, 6, 12, 16)
)
MAPS = tuple(
    ScenarioVariant(f"default, {side} x {side} cells", "default", (f"landscape.size={side}",))
    for side in (16, 24, 48, 96, 192)
)
WINDS = tuple(ScenarioVariant(f"default, {speed} m/s", "default", (f"wind.speed={speed}",)) for speed in (0, 2, 8, 12))
GIANT = (ScenarioVariant("giant", "giant"),)
SPECIALISTS = tuple(
    ScenarioVariant(f"spread_{name}", f"spread_{name}", rival=name) for name in ("skirmish", "single", "default")
)


def on_ground(folder: str) -> tuple[ScenarioVariant, ...]:
    """Return the places on the real ground of a folder: of cells and steps, and in metres and minutes."""
    path = f"landscape.path='{folder}'"
    return (ScenarioVariant("landfire", "landfire", (path,)), ScenarioVariant("wildland", "wildland", (path,)))


PLACES = {
    "scenarios": OURS,
    "spread": SPREAD,
    "teams": TEAMS,
    "maps": MAPS,
    "winds": WINDS,
    "giant": GIANT,
    "specialists": SPECIALISTS,
}
"""Groups of places; those on real ground need a folder."""
RIVALS = ("local", "greedy", "coordinated", "dispatch", "ring", "mixed")
"""The baselines for teams that see the fire; the others search for it, watch it, or share a land."""
REFERENCE = "coordinated"
"""The baseline that every row tells of."""

_CELLS = 2**20
"""Of the worlds that play at once: 64 of ``giant`` take 9 GiB."""


def generalise(
    path: str, places: Sequence[ScenarioVariant], device: str, episodes: int, overrides: Sequence[str] = ()
) -> Iterator[dict[str, Any]]:
    """Yield a row for each place: what the policy, its rival and ``REFERENCE`` save, and paired differences.

    The rival is the best baseline, or the policy that the place names. The fires of large maps play in several
    batches, which fit into the memory.

    Args:
        path: Of a policy, or the name of a shipped one.
        places: Where it plays.
        device: Where the worlds live.
        episodes: Fires, on seeds from ``FIRST_SEED`` on.
        overrides: Further ones in all places.
    """
    policy = load_policy(path).to(device)
    places = [place._replace(overrides=(*place.overrides, *overrides)) for place in places]
    for place in places:  # what is wrong is told before anything is played
        env = _env(place, policy, FIRST_SEED, n_worlds=1)
        policy.fitted(env)(env.reset())
    for place in places:
        yield _row(place, policy, episodes)


def _row(place: ScenarioVariant, policy: TrainedPolicy, episodes: int) -> dict[str, Any]:
    names = RIVALS if place.rival is None else (REFERENCE,)
    saved = _saved_by_baselines(place, policy, names, episodes)
    if place.rival is None:
        rival = max(saved, key=lambda name: float(saved[name].mean()))
    else:
        rival = f"specialist {place.rival}"
        saved[rival] = _saved(place, load_policy(place.rival).to(_device(policy)), episodes)
    own = _saved(place, policy, episodes)
    return {
        "place": place.name,
        "episodes": episodes,
        "policy": summarise(own),
        "rival": rival,
        "beside": summarise(saved[rival]),
        "difference": compare(own, saved[rival]),
        "reference": summarise(saved[REFERENCE]),
        "to_reference": compare(own, saved[REFERENCE]),
    }


def _env(place: ScenarioVariant, policy: TrainedPolicy, first_seed: int, n_worlds: int) -> WildfireEnv:
    """Return the worlds of a place, in which a policy sees what it was trained on."""
    changes = [*policy.overrides, *place.overrides]
    return make_env(place.scenario, n_worlds=n_worlds, seed=first_seed, device=_device(policy), overrides=changes)


def _device(policy: TrainedPolicy) -> torch.device:
    return next(policy.parameters()).device


def _batches(place: ScenarioVariant, policy: TrainedPolicy, episodes: int) -> Iterator[tuple[WildfireEnv, int]]:
    """Yield the worlds of each batch, and the seed of their first, for ``episodes`` fires in all."""
    height, width = _env(place, policy, FIRST_SEED, n_worlds=1).world.size
    most = max(1, _CELLS // (height * width))
    for start in range(0, episodes, most):
        first_seed = FIRST_SEED + start
        yield _env(place, policy, first_seed, min(most, episodes - start)), first_seed


def _saved(place: ScenarioVariant, policy: TrainedPolicy, episodes: int) -> np.ndarray:
    """Return the trees that a policy saves in each fire, float64 [episodes]."""
    batches = _batches(place, policy, episodes)
    return np.concatenate([play(env, policy.fitted(env), first, policy.mode)["saved"] for env, first in batches])


def _saved_by_baselines(
    place: ScenarioVariant, policy: TrainedPolicy, names: Sequence[str], episodes: int
) -> dict[str, np.ndarray]:
    """Return the trees that baselines save in each fire, float64 [episodes] by name."""
    parts = [play_heuristics(env, first, names) for env, first in _batches(place, policy, episodes)]
    return {name: np.concatenate([part[name]["saved"] for part in parts]) for name in names}


def generalist_table(rows: Sequence[dict[str, Any]]) -> str:
    """Return the rows as a Markdown table, and on how many places the policy beats its rivals."""
    lines = [
        f"Trees saved, %, and 95 % intervals over {rows[0]['episodes']} fires, seeds from {FIRST_SEED}; differences "
        "are paired by fire",
        "",
        f"| where | policy | rival | | difference | to `{REFERENCE}` |",
        "|---|---|---|---|---|---|",
    ]
    lines += [table_line(row) for row in rows]
    rival, reference = (
        f"on {_count(rows, key, 1)}, and behind it on {_count(rows, key, -1)}" for key in ("difference", "to_reference")
    )
    told = f"Of {len(rows)} places ahead of the rival, intervals apart, {rival}; of `{REFERENCE}` {reference}."
    return "\n".join([*lines, "", told])


def table_line(row: Mapping[str, Any]) -> str:
    """Return a row as a line of the table."""
    return (
        f"| {row['place']} | {interval_cell(row['policy'])} | {row['rival']} | {interval_cell(row['beside'])} | "
        f"{difference_cell(row['difference'])} | {difference_cell(row['to_reference'])} |"
    )


def _count(rows: Sequence[Mapping[str, Any]], key: str, sign: int) -> int:
    """Return the number of places where a difference, with its whole interval, has a sign."""
    return sum(min(sign * bound for bound in row[key]["ci95"]) > 0.0 for row in rows)
