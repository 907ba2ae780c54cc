"""Rows of ``metrics.csv``, and lines of the log."""

from collections.abc import Mapping, Sequence

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.algorithms import parallel
from warp_torchrl.env.specs import EPISODE_METRICS
from warp_torchrl.models import CANONICAL, OBSERVATION, RADIO, REWARD, SENT, STATE, VALUE
from warp_torchrl.models.signature import Key
from warp_torchrl.system.finite import are_unsound

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


def episode_columns(
    batches: Sequence[TensorDictBase], kinds: Sequence[str] = ("",)
) -> tuple[dict[str, float | None], list[str]]:
    """Return the metrics of batches [B, T] of all processes, read from the device at once.

    Args:
        batches: One of each kind of worlds.
        kinds: Their names.

    Returns:
        The mean metrics of the episodes that ended, None where none ended, and the share of trees saved of each kind if
        there are several; and which ``NUMBERS`` are not finite.
    """
    info = batches[0]["next", "info"]
    names = [*EPISODE_METRICS, *sorted(name for name in info.keys() if name not in EPISODE_METRICS)]
    of_kinds = parallel.sum_(torch.stack([_sums(batch, names) for batch in batches])).tolist()
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
    return row, [what for what, count in zip(NUMBERS, unsound, strict=True) if count]


def _sums(batch: TensorDictBase, names: Sequence[str]) -> Tensor:
    """Return which ``NUMBERS`` are not finite, how many episodes ended, and the sums of their metrics, float64."""
    done, info = batch["next", "done"][..., 0], batch["next", "info"]
    sums = [*_unsound(batch), done.sum(), *(torch.where(done, info[name][..., 0], 0.0).sum() for name in names)]
    return torch.stack([each.double() for each in sums])


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
