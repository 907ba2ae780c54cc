"""What a world cannot fill is left out of products, and what is worked out stays the same."""

import pytest
import torch
from torch import nn
from torchrl.envs import TransformedEnv

from tests.conftest import small_world
from warp_torchrl.algorithms.held_batch import with_advantages
from warp_torchrl.algorithms.ppo import Ppo
from warp_torchrl.entries import Empty, Follows, Quarters
from warp_torchrl.env import WildfireEnv
from warp_torchrl.models import CANONICAL_STATE, LOGITS, STATE, VALUE, Cnn, Entry, Mlp, signature
from warp_torchrl.models.networks import LinearEncoder
from warp_torchrl.models.packing import Packing
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

VIEW = Entry((4, 3, 3), "uint8", content=(None, Follows(0, -0.5, 128.0), Empty(), None))
MAP = Entry((3, 4, 4), "float32", content=(Empty(), None, Quarters()))


def flat_env(n_worlds):
    return WildfireEnv(small_world(landscape=Perlin(size=12)), n_worlds=n_worlds)


def planes(n=5):
    view = torch.randint(0, 256, (n, 4, 3, 3), dtype=torch.uint8)
    view[:, 0] = view[:, 0] // 2 * 2
    view[:, 1], view[:, 2] = 128 - view[:, 0] // 2, 0
    maps = torch.randn(n, 3, 4, 4)
    maps[:, 0] = 0.0
    maps[:, 2] = torch.randn(n, 2, 1, 2, 1).expand(n, 2, 2, 2, 2).reshape(n, 4, 4)
    return view, maps


def test_products_and_gradients_are_those_over_whole_planes():
    torch.manual_seed(0)
    packed = LinearEncoder([VIEW, MAP, Entry((2,), "float32")], 7)
    whole = LinearEncoder([VIEW.bare(), MAP.bare(), Entry((2,), "float32")], 7)
    whole.load_state_dict(packed.state_dict())
    view, maps = planes()
    given = view, maps, torch.randn(5, 2)
    for encoder in (packed, whole):
        encoder(*given).square().sum().backward()
    assert torch.allclose(packed(*given), whole(*given), atol=1e-5)
    for one, other in zip(packed.parameters(), whole.parameters(), strict=True):
        assert torch.allclose(one.grad, other.grad, rtol=1e-6, atol=1e-6 * float(other.grad.abs().max()))


def test_an_entry_is_packed_once():
    torch.manual_seed(0)
    encoder, (view, maps) = LinearEncoder([VIEW, MAP], 7), planes()
    small = [Packing(entry).packed(given) for entry, given in ((VIEW, view), (MAP, maps))]
    assert [each.shape[1] for each in small] == [2 * 9, 16 + 4]
    assert all(torch.equal(Packing(entry).packed(each), each) for entry, each in zip((VIEW, MAP), small, strict=True))
    assert torch.equal(encoder(*small), encoder(view, maps))


def test_a_plane_follows_one_that_is_read():
    with pytest.raises(ValueError, match="plane 1 must follow one that can hold anything, got 0"):
        Packing(Entry((2, 3, 3), "uint8", content=(Empty(), Follows(0, 1.0, 0.0))))


@pytest.mark.parametrize("model", [Mlp(dtype="float32"), Mlp(dtype="float32", symmetry="none"), Cnn()], ids=str)
@pytest.mark.parametrize("sharing", ["team", "role", "none"])
def test_teams_learn_the_same_from_batches_without_them(model, sharing):
    model = type(model)(**{**vars(model), "sharing": sharing})
    env = flat_env(4)
    torch.manual_seed(0)
    batch, found = env.rollout(6, break_when_any_done=False), []
    for shape in (signature(env), signature(env).bare()):
        torch.manual_seed(1)
        learner = Ppo(minibatch_size=8).build(env, model, 24)
        policy, critic = Ppo().policy(shape, model), model.critic(shape, central=True)
        policy.load_state_dict(learner.policy.state_dict())
        found.append((policy(batch.clone())[LOGITS], critic(batch.clone())[VALUE]))
    for one, other in zip(*found, strict=True):
        assert torch.allclose(one, other, atol=1e-5)


def test_the_buffer_holds_what_can_differ():
    env = flat_env(2)
    for model, key in ((Mlp(), CANONICAL_STATE), (Mlp(symmetry="none"), STATE)):
        learner = Ppo().build(env, model, 8)
        batch = env.rollout(4, learner.policy, break_when_any_done=False)
        stored = with_advantages(learner.loss, batch, model.canonical_batch(signature(env), packed=True))
        assert stored[key].shape[1:] == (5 * 256 + 4,)
        assert stored["agents", "advantage"].isfinite().all()
    assert stored["agents", "observation", "view"].shape[2:] == (9 * 121,)
    whole = with_advantages(learner.loss, batch, model.canonical_batch(signature(env)))
    assert torch.allclose(stored["agents", "advantage"], whole["agents", "advantage"], atol=1e-2)


def test_weights_of_what_is_left_out_are_kept_for_worlds_that_fill_it():
    flat = flat_env(3)
    hills = WildfireEnv(
        small_world(landscape=Perlin(size=12, relief=300.0), team=Team(roles=("ugv", "uav"))), n_worlds=3
    )
    told = [each is None for each in signature(hills).observation["view"].content]
    assert told[7] and signature(flat).observation["view"].content[7] is not None
    here, there = (Mlp().actor(signature(env)) for env in (flat, hills))
    there.load_state_dict(here.state_dict())
    now = hills.reset()
    before = there(now.clone())[LOGITS]
    now["agents", "observation", "view"][:, :, 7] = 0
    assert (there(now)[LOGITS] != before).any()


def test_a_transform_may_fill_what_the_world_leaves_empty():
    env = flat_env(2)
    assert signature(env).state.content and not signature(TransformedEnv(env)).state.content
    assert signature(TransformedEnv(env)) == signature(env).bare()


def test_layers_over_what_may_differ_alone_are_those_of_before():
    torch.manual_seed(0)
    encoder, numbers = LinearEncoder([Entry((4,), "float32")], 3), torch.randn(6, 4)
    assert torch.equal(encoder(numbers), nn.functional.linear(numbers, encoder.parts[0].weight, encoder.parts[0].bias))
