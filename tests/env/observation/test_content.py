"""What planes can hold in a world is what they hold there, whatever is played."""

import pytest
import torch

from tests.conftest import small_world
from warp_torchrl.entries import Empty, Follows, Quarters
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import Local, Surroundings
from warp_torchrl.world.air.wind import Wandering
from warp_torchrl.world.team.team import Team
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.fixed import Fixed
from warp_torchrl.world.terrain.landscape import Perlin

FOREST = [[3] * 12] * 12
HILLS = [[10.0 * row] * 12 for row in range(12)]
WORLDS = {
    "flat": {"landscape": Perlin(size=12)},
    "hills": {"landscape": Perlin(size=12, relief=400.0)},
    "hills sometimes": {"landscape": Perlin(size=12, relief=(0.0, 400.0))},
    "an array": {"landscape": Array(cover=FOREST)},
    "an array of hills": {"landscape": Array(cover=FOREST, elevation=HILLS)},
    "one ground": {"landscape": Fixed(source=Perlin(size=12), seed=3)},
    "one": {"team": Team(n_agents=1)},
    "one of each": {"team": Team(n_agents=2, roles=("ugv", "uav"))},
    "aircraft": {"team": Team(n_agents=3, roles=("uav",))},
    "changing wind": {"wind": Wandering()},
}


def holds(planes, content):
    """Whether planes [..., C, S, S] hold what is told of them."""
    side = planes.shape[-1] // 2
    for plane, told in zip(planes.unbind(-3), content, strict=True):
        if isinstance(told, Empty):
            yield (plane == 0).all()
        if isinstance(told, Quarters):
            quarters = plane.unflatten(-1, (2, side)).unflatten(-3, (2, side))
            yield (quarters == quarters[..., :, :1, :, :1]).all()
        if isinstance(told, Follows):
            yield torch.allclose(plane.float(), told.offset + told.factor * planes[..., told.of, :, :].float())


@pytest.mark.parametrize("world", WORLDS.values(), ids=WORLDS)
@pytest.mark.parametrize("observation", [Surroundings(), Surroundings(centred=False, near=3), Local(radius=2)], ids=str)
def test_a_plane_holds_what_is_told_of_it(world, observation):
    env = WildfireEnv(small_world(**world), observation=observation, n_worlds=4)
    torch.manual_seed(0)
    seen = env.rollout(8, break_when_any_done=False)
    assert all(holds(seen["state"], env.state_content))
    for name, content in env.contents.items():
        assert not content or all(holds(seen["agents", "observation", name], content))


def test_a_preset_that_shows_channels_its_own_way_is_read_whole():
    class Noisy(Surroundings):
        def __call__(self, state, world, forecast):
            return super().__call__(state, world, forecast)

    class Renamed(Surroundings):
        pass

    spaces = Noisy().spaces(small_world(landscape=Perlin(size=12)))
    assert spaces["view"].content == spaces["picture"].content == ()
    assert Renamed().spaces(small_world())["view"].content


def test_what_a_world_fills_is_never_left_out():
    hilly = small_world(landscape=Perlin(size=12, relief=(0.0, 400.0)))
    view = Local().spaces(hilly)["view"]
    assert view.content[view.names.index("relative_elevation")] is None
    flat = Local(channels=("fire_stage", "relative_elevation")).spaces(small_world(landscape=Perlin(size=12)))["view"]
    assert flat.content == (None, None), "nothing else tells where the map ends"
    team = small_world(team=Team(n_agents=4, roles=("ugv", "uav")))
    assert Local().spaces(team)["view"].content[-2:] == (None, None)
