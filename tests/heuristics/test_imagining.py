"""Imagined play: what is measured of each world, in its place."""

import torch

from warp_torchrl import make_env
from warp_torchrl.heuristics import Dispatch
from warp_torchrl.heuristics.imagining import played, trees_saved


def test_each_world_is_measured_as_alone_wherever_it_ends() -> None:
    env = make_env("skirmish", n_worlds=16)
    env.reset()
    state, world, choose = env.world_state, env.world, Dispatch(env).choose
    ends = played(world, state, choose, 128, lambda now, _: now.step)
    assert len(ends.unique()) > 8 and not torch.equal(ends, ends.sort().values), "worlds end apart, in another order"
    saved = played(world, state, choose, 128, trees_saved)
    alone = [played(world, state[at : at + 1], choose, 128, trees_saved) for at in range(0, 16, 3)]
    assert torch.equal(saved[::3], torch.cat(alone))


def test_the_first_action_may_be_given_and_the_horizon_ends_the_play() -> None:
    env = make_env("skirmish", n_worlds=4)
    env.reset()
    state, world, choose = env.world_state, env.world, Dispatch(env).choose
    first = choose(state, world.possible_actions(state)).flip(0)
    after = world.step(state, first)
    assert torch.equal(
        played(world, state, choose, 1, trees_saved, first), trees_saved(after.after, after.counts_after)
    )
    assert played(world, state, choose, 3, lambda now, _: now.step).tolist() == [3] * 4
