"""What vehicles of several agencies are shown of the lands."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.env.observation import CriticState, Local, Surroundings
from warp_torchrl.env.observation.channels import DEFAULT
from warp_torchrl.world.mechanics.agencies.agencies import SeveralAgencies, lands_of
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.landscape import Perlin

CHANNELS = (*DEFAULT, "own_land")


def worlds(size=16, **options):
    world = small_world(
        landscape=Perlin(size=size, relief=0.0), team=Team(n_agents=4), agencies=SeveralAgencies(**options)
    )
    return world, world.reset(torch.arange(4), torch.zeros(4, dtype=torch.int64))


def shown(preset, state, world):
    return preset(state, world, world.forecast(state))


def test_the_view_shows_the_land_of_whom_it_serves_and_nothing_beyond_the_map():
    world, state = worlds()
    state.vehicles.position[:, :2] = torch.tensor([[0, 0], [7, 9]])
    view = shown(Local(radius=2, channels=CHANNELS), state, world)["view"][:, :, -1]
    owner = lands_of(state).owner
    assert torch.equal(view[:, 1], (owner[:, 5:10, 7:12] == 0) * torch.tensor(255, dtype=torch.uint8))
    assert (view[:, 0, :2] == 0).all() and (view[:, 0, :, :2] == 0).all()
    assert torch.equal(view[:, 0, 2:, 2:] == 255, owner[:, :3, :3] == 0)
    lent = state.with_planes("agencies", lands_of(state).replace(serves=1 - lands_of(state).serves))
    assert torch.equal(shown(Local(radius=2, channels=CHANNELS), lent, world)["view"][:, 1, -1] == 255, view[:, 1] == 0)


def test_the_picture_tells_the_share_of_each_block():
    world, state = worlds()
    whole = shown(Surroundings(centred=False), state, world)["picture"]
    assert whole.shape == (4, 4, 4, 8, 8)
    mine = (lands_of(state).owner == 1).float().unflatten(1, (8, 2)).unflatten(3, (8, 2)).mean((2, 4))
    assert torch.allclose(whole[:, 2, 3], mine)
    state.vehicles.position[:, 2] = torch.tensor([5, 12])  # block 2, 6
    about = shown(Surroundings(), state, world)["picture"][:, 2, 3]
    assert torch.equal(about[:, 5:13, 1:9], (mine * 255).to(torch.uint8))
    assert about.long().sum((1, 2)).tolist() == (mine * 255).to(torch.uint8).long().sum((1, 2)).tolist()


def test_a_vehicle_knows_whom_it_serves():
    world, state = worlds(own=1)
    own = shown(Local(), state, world)["status"]
    assert Local().spaces(world)["status"].names[-2:] == ("agency_0", "agency_1")
    assert own[0, :, -2:].tolist() == [[1, 0], [0, 1], [1, 0], [0, 1]]


def test_the_critic_sees_lands_and_who_serves_them():
    world, state = worlds()
    shown = CriticState(world)
    planes = dict(zip(shown.names, shown(state, world.forecast(state)).unbind(1), strict=True))
    assert torch.equal(planes["land_of_agency_0"], (lands_of(state).owner == 0).float())
    assert torch.equal(planes["land_of_agency_0"] + planes["land_of_agency_1"], torch.ones(4, 16, 16))
    row, column = state.vehicles.position[0, 2].tolist()
    assert planes["vehicles_of_agency_1"][0, row, column] == 1.0
    assert planes["vehicles_of_agency_0"].sum() == planes["vehicles_of_agency_1"].sum() == 8.0
    assert shown.symmetry.fits(shown.shape) and shown.shape == (len(shown.names), 16, 16)


def test_worlds_of_one_agency_show_no_land():
    world = small_world()
    state = world.reset(torch.arange(2), torch.zeros(2, dtype=torch.int64))
    assert not shown(Local(channels=CHANNELS), state, world)["view"][:, :, -1].any()
    assert "own_land" not in Surroundings().spaces(world)["picture"].names
    assert not any("agency" in name for name in CriticState(world).names)


@pytest.mark.parametrize("centred", [True, False])
def test_nothing_is_left_out_that_a_world_fills(centred):
    world, state = worlds()
    preset = Surroundings(channels=CHANNELS, centred=centred)
    for name, entry in shown(preset, state, world).items():
        space = preset.spaces(world)[name]
        low, high = space.bounds()
        assert entry.shape[2:] == space.shape and (entry >= low).all() and (entry <= high).all()
