"""Running normalisation of rewards."""

import torch
from tensordict import TensorDict

from warp_torchrl.training.reward_scale import RewardScale


def batch(reward, done=None):
    """Of rewards [B, T, A]."""
    worlds, steps, agents = reward.shape
    done = torch.zeros(worlds, steps, 1, dtype=torch.bool) if done is None else done
    agents_part = TensorDict({"reward": reward.clone()[..., None]}, batch_size=[worlds, steps, agents])
    return TensorDict({"next": {"agents": agents_part, "done": done}}, batch_size=[worlds, steps])


def test_rewards_are_divided_by_the_deviation_of_their_discounted_sums():
    # gamma 0.5, one world and agent: 1, 0, 2 sum up to 1, 0.5, 2.25; the episode ends; 4 starts anew.
    reward = torch.tensor([1.0, 0.0, 2.0, 4.0])[None, :, None]
    done = torch.tensor([False, False, True, False])[None, :, None]
    scale, data = RewardScale(0.5), batch(reward, done)
    scale(data)
    deviation = torch.tensor([1.0, 0.5, 2.25, 4.0]).std(correction=0)
    torch.testing.assert_close(data["next", "agents", "reward"][0, :, 0, 0], reward[0, :, 0] / deviation)


def test_sums_and_moments_go_on_over_batches_as_over_one():
    reward = torch.randn(3, 40, 2, generator=torch.Generator().manual_seed(0)) + 1.0
    whole, parts = RewardScale(0.9), RewardScale(0.9)
    whole(batch(reward))
    for part in reward.split(8, dim=1):
        parts(batch(part))
    torch.testing.assert_close(parts.deviation, whole.deviation)
    again = RewardScale(0.9)
    again.load_state_dict(parts.state_dict())
    later = torch.ones(3, 4, 2)
    one, two = batch(later), batch(later)
    parts(one), again(two)
    assert (one == two).all()


def test_rewards_without_spread_stay_finite():
    data = batch(torch.zeros(2, 3, 1))
    RewardScale(0.9)(data)
    assert (data["next", "agents", "reward"] == 0.0).all()
