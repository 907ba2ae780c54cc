"""Rows of ``metrics.csv``, the progress bar, and lines of the log."""

import logging
from collections.abc import Mapping, Sequence
from itertools import islice

import numpy as np
import torch
from tensordict import TensorDictBase
from torch import Tensor
from tqdm import tqdm

from warp_torchrl.algorithms import parallel
from warp_torchrl.env.specs import EPISODE_METRICS
from warp_torchrl.models import ACTION, CANONICAL, OBSERVATION, RADIO, REWARD, SENT, STATE, VALUE
from warp_torchrl.models.signature import Key
from warp_torchrl.system.finite import are_unsound
from warp_torchrl.training.callbacks import OngoingTraining
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.team.team import Team

log = logging.getLogger("warp_torchrl")
_SECONDS_BETWEEN_LINES = 15.0
NUMBERS = ("a reward", "an observation", "an output of the policy")
"""What a batch holds that must be finite."""
TRAIN_COLUMNS = (
    "train/policy_gradient_loss",
    "train/value_loss",
    "train/entropy",
    "train/entropy_loss",
    "train/approx_kl",
    "train/clip_fraction",
    "train/clip_range",
    "train/explained_variance",
    "train/learning_rate",
)
"""Columns of ``metrics.csv`` that every run has; empty where an algorithm has no value for them."""


_MOST_AGENTS = 16
"""With a column each."""


def batch_columns(
    batches: Sequence[TensorDictBase], teams: Sequence[Team], kinds: Sequence[str] = ("",)
) -> tuple[dict[str, float | None], list[str]]:
    """Return the metrics of batches [B, T] of all processes, read from the device at once.

    Args:
        batches: One of each kind of worlds.
        teams: Those of each kind.
        kinds: Their names.

    Returns:
        The mean metrics of the episodes that ended, None where none ended, and the share of trees saved of each kind if
        there are several; what agents and roles did, see ``_team_columns``; and which ``NUMBERS`` are not finite.
    """
    info = batches[0]["next", "info"]
    names = [*EPISODE_METRICS, *sorted(name for name in info.keys() if name not in EPISODE_METRICS)]
    acts = [_acts(batch, team) for batch, team in zip(batches, teams, strict=True)]
    sums = torch.stack([_sums(batch, names) for batch in batches])
    numbers = parallel.sum_(torch.cat([sums.flatten(), *(each.flatten() for each in acts)])).tolist()
    rest = iter(numbers)
    of_kinds = [list(islice(rest, sums.shape[1])) for _ in batches]
    of_teams = [np.array(list(islice(rest, each.numel()))).reshape(each.shape) for each in acts]
    *unsound, count = map(sum, zip(*(sums[: len(NUMBERS) + 1] for sums in of_kinds), strict=True))
    totals = map(sum, zip(*(sums[len(NUMBERS) + 1 :] for sums in of_kinds), strict=True))
    means = {name: total / count if count else None for name, total in zip(names, totals, strict=True)}
    row = {"rollout/ep_rew_mean": means.pop("episode_reward"), "rollout/ep_len_mean": means.pop("episode_length")}
    row |= {f"world/{name}": value for name, value in means.items()}
    if len(kinds) > 1:
        ended = len(NUMBERS)
        saved = ended + 1 + names.index("saved")
        row |= {
            f"mixture/saved_{kind}": sums[saved] / sums[ended] if sums[ended] else None
            for kind, sums in zip(kinds, of_kinds, strict=True)
        }
    row |= _team_columns(of_teams, teams)
    return row, [what for what, count in zip(NUMBERS, unsound, strict=True) if count]


def _sums(batch: TensorDictBase, names: Sequence[str]) -> Tensor:
    """Return which ``NUMBERS`` are not finite, how many episodes ended, and the sums of their metrics, float64."""
    done, info = batch["next", "done"][..., 0], batch["next", "info"]
    sums = [*_unsound(batch), done.sum(), *(torch.where(done, info[name][..., 0], 0.0).sum() for name in names)]
    return torch.stack([each.double() for each in sums])


def _acts(batch: TensorDictBase, team: Team) -> Tensor:
    """Return sums over a batch for each agent, float64 [2 + abilities, A]: its steps, rewards, and acts of each."""
    action, reward = batch[ACTION], batch["next", *REWARD][..., 0]
    chosen = [each.is_chosen(action) for each in team.abilities]
    return torch.stack([each.sum((0, 1), dtype=torch.float64) for each in (torch.ones_like(reward), reward, *chosen)])


def _team_columns(sums: Sequence[np.ndarray], teams: Sequence[Team]) -> dict[str, float]:
    """Return what agents and roles did, from what ``_acts`` returns of each kind of worlds.

    ``agents/reward_<agent>`` is the mean reward of a step, of teams of 2 to 16 in one kind of worlds;
    ``roles/reward_<role>`` that of a role where there are several, and ``roles/<ability>_<role>`` the share of steps in
    which agents of the role chose an action of the ability.
    """
    found: dict[str, float] = {}
    if len(teams) == 1 and 1 < teams[0].n_agents <= _MOST_AGENTS:
        steps, rewards = sums[0][:2]
        means = zip(teams[0].agent_names, rewards / steps, strict=True)
        found |= {f"agents/reward_{agent}": float(mean) for agent, mean in means}
    roles = dict.fromkeys(role for team in teams for role in team.agent_roles)
    for role in roles:
        its = sum(each[:, np.array(team.agent_roles) == role].sum(axis=1) for each, team in zip(sums, teams))
        steps, reward, *acts = its
        found |= {f"roles/reward_{role}": float(reward / steps)} if len(roles) > 1 else {}
        names = (each.name for each in teams[0].abilities)
        found |= {
            f"roles/{name}_{role}": float(n / steps) for name, n in zip(names, acts) if name in ROLES[role].abilities
        }
    return found


def _unsound(batch: TensorDictBase) -> list[Tensor]:
    """Return which ``NUMBERS`` of a batch are not finite, bool [] each, without a synchronisation."""
    held: dict[str, list[Tensor]] = {what: [] for what in NUMBERS}
    for key, value in batch.items(include_nested=True, leaves_only=True):
        way = key if isinstance(key, tuple) else (key,)
        way = way[1:] if way[0] == "next" else way
        if value.is_floating_point() and way[0] != "info":
            held[_what(way)].append(value)
    return [are_unsound(each).to(batch["next", "done"].device) for each in held.values()]


def _what(key: Key) -> str:
    """Return the item of ``NUMBERS`` to which an entry of a batch belongs."""
    if key == REWARD:
        return NUMBERS[0]
    seen = key[:2] in (OBSERVATION, SENT, RADIO) or key[-1].startswith((STATE, CANONICAL[-1]))
    return NUMBERS[1] if seen and key != VALUE else NUMBERS[2]


def line(row: Mapping[str, float | None], total: int) -> str:
    """Return a row as a line of the log.

    Args:
        row: A row of ``metrics.csv``.
        total: World steps of the whole training.
    """

    def show(name: str, pattern: str) -> str:
        return "-" if row[name] is None else pattern.format(row[name])

    frames = row["time/frames"] or 0
    return (
        f"{min(100.0, 100 * frames / total):5.1f} %  {frames} frames  {row['time/seconds']:.0f} s  "
        f"{row['time/fps']:.0f} frames/s  saved {show('world/saved', '{:.3f}')}  "
        f"reward {show('rollout/ep_rew_mean', '{:.2f}')}  loss {show('train/loss', '{:.3f}')}"
    )


class ProgressBar:
    """A callback that shows a bar in a terminal, and elsewhere logs a line now and then.

    Args:
        total: World steps of the whole training.
        frames: Those that were made before.
    """

    def __init__(self, total: int, frames: int = 0) -> None:
        self._total, self._next_line = total, 0.0
        self._bar = tqdm(total=total, initial=frames, unit="frame", disable=None, dynamic_ncols=True)

    def on_batch(self, training: OngoingTraining, row: Mapping[str, float | None]) -> None:
        """Show how far the training is."""
        self._bar.update(training.last_batch)
        self._bar.set_postfix(saved=row["world/saved"], refresh=False)
        is_last = training.frames >= self._total
        if self._bar.disable and (training.seconds >= self._next_line or is_last):
            self._next_line = training.seconds + _SECONDS_BETWEEN_LINES
            log.info(line(row, self._total))
        if is_last:
            self._bar.close()  # before lines of the log

    def on_end(self, training: OngoingTraining) -> None:
        """Leave the bar's line."""
        self._bar.close()


def batch_size_notice(total: int, end: int, n_worlds: int, steps: int, key: str = "steps") -> str | None:
    """Return a notice where ``total_frames`` is no whole number of batches; None where it is.

    Args:
        total: World steps of the whole training.
        end: Those after which it ends.
        n_worlds: Worlds in a batch.
        steps: Steps of each world in the next batch.
        key: Of the collector, which says so.
    """
    batch = n_worlds * steps
    if total == end:
        return None
    what = f"one batch is {batch} frames, n_worlds={n_worlds} x collector.{key}={steps}"
    if total < batch:
        return f"total_frames={total} is less than one batch: {what}, and one is trained on"
    return f"{what}: training ends at {end} frames, not at total_frames={total}"
