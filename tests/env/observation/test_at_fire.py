"""What the aircraft of Haksar and Schwager see, by hand."""

import pytest
import torch

from tests.env.observation.test_observation import drawn
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.env.observation.at_fire import AtFire
from warp_torchrl.models import LOGITS, Mlp, signature


def seen(cells, positions, **options):
    state, world = drawn(cells, positions)
    burned = state.burned.clone()
    burned[0] = state.cells[0] == 0
    return AtFire(**options)(state.replace(burned=burned), world, None)


def test_the_image_shows_fire_and_burnt_trees_about_an_agent_and_all_beyond_the_map_as_healthy():
    cells = torch.full((8, 8), 5)
    cells[0, 1], cells[1, 0], cells[4, 4] = 11, 0, 11
    image = seen(cells.tolist(), [[0, 0], [4, 4]])["image"][0]
    assert image.tolist() == [[0, 0, 0, 0, 0, 1, 0, 2, 0], [0, 0, 0, 0, 1, 0, 0, 0, 0]]
    assert seen(cells.tolist(), [[0, 0], [4, 4]], radius=2)["image"].shape == (1, 2, 25)


def test_they_are_told_the_way_round_the_middle_and_where_the_nearest_of_them_is():
    # The middle of 8 x 8 is at (3.5, 3.5). The first is 3.5 west and 3.5 north of it: clockwise is north-east.
    told = seen(torch.full((8, 8), 5).tolist(), [[0, 0], [0, 4]])["told"][0]
    half = 0.5**0.5
    assert told[0].tolist() == pytest.approx([half, half, 0.0, -1.0, 0.0])
    # The second is 0.5 east and 3.5 north of it.
    assert told[1].tolist() == pytest.approx([3.5 / 12.5**0.5, -0.5 / 12.5**0.5, 1.0, 1.0, 0.0])


def test_agents_in_one_cell_are_told_no_direction():
    told = seen(torch.full((8, 8), 5).tolist(), [[2, 2], [2, 2]])["told"][0]
    assert told[:, 2:].tolist() == [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]


def test_networks_read_it_north_up():
    env = make_env("haksar", n_worlds=2, overrides=["observation=at_fire", "landscape.size=16"])
    assert Mlp(symmetry="none").actor(signature(env))(env.reset())[LOGITS].shape == (2, 10, 11)
    with pytest.raises(ValueError, match="symmetry"):
        Mlp().actor(signature(env))


@needs("sensing")
def test_it_is_refused_where_agents_do_not_see_all():
    with pytest.raises(ValueError, match="sensing must be full with observation=at_fire"):
        make_env("haksar", n_worlds=1, overrides=["observation=at_fire", "sensing=sight"])
