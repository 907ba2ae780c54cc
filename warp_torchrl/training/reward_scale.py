"""Reward normalisation."""

import torch
from tensordict import TensorDictBase
from torch import Tensor

from warp_torchrl.algorithms import parallel
from warp_torchrl.models import REWARD


class RewardScale:
    """Divides rewards by the running standard deviation of their discounted sums.

    It does not subtract the mean, as TorchRL's normalising transforms do: a shift would reward longer or shorter
    episodes.

    Args:
        gamma: Discount factor.
    """

    def __init__(self, gamma: float) -> None:
        self.gamma = gamma
        self._sums: Tensor | None = None  # [B, A], of the episodes not yet finished
        self._moments = torch.zeros(3, dtype=torch.float64)  # count, mean, sum of squared departures

    def __call__(self, batch: TensorDictBase) -> None:
        """Update the statistics with a batch [B, T], then scale its rewards in place."""
        reward = batch["next", *REWARD]
        rewards, done = reward[..., 0], batch["next", "done"]
        if self._sums is None:
            self._sums = torch.zeros_like(rewards[:, 0])
        self._moments = self._moments.to(rewards.device)
        sums = torch.empty_like(rewards)
        for step in range(rewards.shape[1]):
            sums[:, step] = self._sums * self.gamma + rewards[:, step]
            self._sums = sums[:, step] * ~done[:, step]
        self._add(sums.double())
        reward.div_(self.deviation.to(reward.dtype).clamp(min=1e-8))

    @property
    def deviation(self) -> Tensor:
        """Return the standard deviation so far, float64 []."""
        return (self._moments[2] / self._moments[0].clamp(min=1.0)).sqrt()

    def _add(self, values: Tensor) -> None:
        """Join the moments of new values of all processes (Chan, Golub and LeVeque 1979)."""
        count, mean, squares = self._moments
        new = values.numel() * parallel.size()
        new_mean = parallel.sum_(values.sum()) / new if parallel.size() > 1 else values.mean()
        total, gap = count + new, new_mean - mean
        departures = parallel.sum_((values - new_mean).square().sum())
        squares = squares + departures + gap * gap * count * new / total
        self._moments = torch.stack((total, mean + gap * new / total, squares))

    def state_dict(self) -> dict[str, Tensor]:
        """Return the running statistics."""
        sums = {} if self._sums is None else {"sums": self._sums.clone()}
        return {"moments": self._moments.clone(), **sums}

    def load_state_dict(self, state: dict[str, Tensor]) -> None:
        """Restore what ``state_dict`` returned."""
        self._moments, self._sums = state["moments"].clone(), state.get("sums")
