"""What agents are shown where they know of the fire what was seen alone."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.drawing import begun, later
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import CriticState, Local, Paper, Surroundings
from warp_torchrl.env.observation.channels import DEFAULT
from warp_torchrl.heuristics import TEACHERS
from warp_torchrl.world.mechanics.sensing.sensing import Sight
from warp_torchrl.world.state.state import Forecast
from warp_torchrl.world.team.knowledge import Full
from warp_torchrl.world.team.places import in_reach

Radio = pytest.importorskip("warp_torchrl.world.mechanics.radio.radio").Radio
DEAF = Radio(range=0.0)
CHANNELS = (*DEFAULT, "last_seen")
PRESETS = {
    "centred": Surroundings(channels=CHANNELS),
    "whole map": Surroundings(channels=CHANNELS, centred=False),
    "near": Surroundings(channels=CHANNELS, near=2),
    "local": Local(channels=CHANNELS),
    **{f"advice by {name}": Local(radius=3, channels=CHANNELS, advice=name) for name in TEACHERS},
    "paper": Paper(),
}


def limited(sight, *mechanics):
    return small_world(sensing=sight, mechanics=mechanics)


def shown(preset, state, world):
    return preset(state, world, world.forecast(state))


def drawn(sight, drawing, at, *mechanics):
    world = limited(sight, *mechanics)
    return begun(world, *at, drawing=drawing), world


@pytest.mark.parametrize("preset", PRESETS.values(), ids=PRESETS)
def test_what_nobody_has_seen_makes_no_difference_to_what_is_shown(preset):
    """A fire beyond sight, ash, a firebreak, a wet tree and a silent team-mate change no number of any entry."""
    sight = Sight(radius=2)
    world = limited(sight, DEAF)
    env = WildfireEnv(world, observation=preset, n_worlds=4, seed=5)
    env.reset()
    state = env.world_state
    hidden = ~in_reach(state, sight.reach(world.team)).any(dim=1)
    other = state.replace(
        cells=torch.where(hidden, 11, state.cells),
        age=torch.where(hidden, 9, state.age),
        burned=state.burned ^ hidden,
        firebreak=state.firebreak ^ hidden,
        wet=torch.where(hidden, 5, state.wet),
    )
    before, after = shown(preset, state, world), shown(preset, other, world)
    assert all(torch.equal(before[name], after[name]) for name in before)
    if "view" not in before:
        return
    moved = state.vehicles.position.clone()
    moved[:, 1] = torch.where(moved[:, 0] < 8, moved[:, 0] + 4, moved[:, 0] - 4)  # in view, beyond sight
    far = state.replace(vehicles=state.vehicles.replace(position=moved))
    assert not world.sensing.knows_where(far, world.team, world.hearing)[0].any()
    alone = far.replace(vehicles=far.vehicles.replace(position=moved[:, :1].expand(-1, 2, -1).contiguous()))
    ours, theirs = shown(preset, far, world), shown(preset, alone, world)
    mates = [CHANNELS.index("other_ugv")]
    assert not ours["view"][:, 0, mates].any() and theirs["view"][:, 0, mates].any()


def test_a_world_that_shows_all_shows_the_same_fire_to_who_sees_all():
    """The check on the check: sight over the whole map shows what full sensing does, but for the threat."""
    far, full = limited(Sight(radius=64)), limited(Full())
    preset = Surroundings(channels=tuple(name for name in DEFAULT if name != "threat"))
    first, second = (WildfireEnv(world, observation=preset, n_worlds=3, seed=1) for world in (far, full))
    ours, theirs = first.reset(), second.reset()
    for _ in range(8):
        ours["agents", "action"] = theirs["agents", "action"] = torch.randint(0, 11, (3, 2))
        ours, theirs = first.step(ours)["next"], second.step(theirs)["next"]
        for name in ("view", "status"):
            assert torch.equal(ours["agents", "observation", name], theirs["agents", "observation", name])
        picture = ours["agents", "observation", "picture"]
        assert torch.equal(picture[:, :, :3], theirs["agents", "observation", "picture"])
        assert picture[:, :, 3].max() == 255


def test_a_view_shows_what_is_known_and_how_fresh_it_is():
    state, world = drawn(Sight(radius=1), "TTTTa TTTTT TTTTT TTTTT TTTTT", [(0, 3), (4, 0)], DEAF)
    now = later(state.replace(step=state.step + 15), world, (0, 0), (4, 0), drawing=" ".join(["T" * 5] * 5))
    view = Local(channels=("fire_stage", "age", "last_seen", "threat"))(now, world, world.forecast(now))["view"][0]
    assert view[0, 0, 5, 9] == 51 and view[0, 0, 5, 5:9].sum() == 0, "the fire of before"
    assert view[0, 1, 5, 5:10].tolist() == [250, 250, 250, 250, 0]
    assert view[0, 2, 5, 5:10].tolist() == [255, 255, 127, 127, 127], "16 steps are half as fresh"
    assert view[0, 2, 8, 5] == 0, "never seen"
    assert view[0, 2, 5, 4] == 0, "beyond the map"
    assert not view[:, 3].any()
    assert view[1, 0].sum() == 0, "the other has not heard of it"


@pytest.mark.parametrize("centred", [True, False], ids=["centred", "whole map"])
def test_team_mates_are_shown_where_they_were_when_they_sent_what_arrives_late(centred):
    """On a map of 16 x 16, whose picture has blocks of two cells; the second agent goes from (4, 4) to (8, 4)."""
    world = limited(Sight(radius=1), Radio(delay=1))
    state = begun(world, (6, 4), (4, 4), drawing=" ".join(["T" * 16] * 16))
    preset = Surroundings(channels=CHANNELS, centred=centred)
    first = shown(preset, state, world)
    mate = CHANNELS.index("other_ugv")
    assert not first["view"][0, 0, mate].any() and not first["picture"][0, 0, 2].any(), "nothing has arrived yet"
    state = later(state, world, (6, 4), (8, 4))
    now = shown(preset, state, world)
    assert now["view"][0, 0, mate].nonzero().tolist() == [[3, 5]], "two cells north of the middle, which is (5, 5)"
    block = [[6, 7]] if centred else [[2, 2]]  # the block north of its own, which is (3, 2) of the map's 8 x 8
    assert now["picture"][0, 0, 2].nonzero().tolist() == block


def test_the_picture_pools_what_is_known():
    sight = Sight(radius=1)
    drawing = " ".join(["T" * 16] * 7 + ["TTTTTTTTTTTTaaTT"] * 2 + ["T" * 16] * 7)
    state, world = drawn(sight, drawing, [(7, 12), (15, 0)], DEAF)
    preset = Surroundings(centred=False)
    picture = preset(state, world, world.forecast(state))["picture"][0]
    assert preset.spaces(world)["picture"].names == ("fire", "fuel", "team_mates", "last_seen")
    # Rows 6 and 7 are block row 3, columns 12 and 13 block column 6: two of its four cells burn, and all were seen.
    assert picture[0, 0, 3, 6].item() == pytest.approx(0.5**0.5) and picture[0, 3, 3, 6] == 1.0
    # Of block (4, 6) it saw row 8 alone.
    assert picture[0, 0, 4, 6].item() == pytest.approx(0.5**0.5) and picture[0, 3, 4, 6] == 0.5
    assert picture[1, 0].sum() == 0.0 and picture[1, 3, 7, 0] == 1.0
    assert picture[:, 2].sum() == 0.0, "each knows nothing of the other"
    assert picture[1, 1, 3, 6] == pytest.approx(world.fire.ground(state.landscape, 30.0, state.key).alpha[0, 7, 12])


def test_the_critic_sees_the_fire_and_what_agents_know_of_it():
    state, world = drawn(Sight(radius=1), " ".join(["T" * 16] * 15 + ["T" * 14 + "aa"]), [(15, 15), (0, 0)])
    planes = dict(zip(CriticState(world).names, CriticState(world)(state, world.forecast(state))[0]))
    assert planes["fire"][15, 14:].tolist() == [1.0, 1.0]
    assert planes["known_fire"][15, 14:].tolist() == [0.5, 0.5], "one of two agents"
    assert planes["last_seen"][15, 14].item() == 0.5 and planes["last_seen"][8, 8] == 0.0
    assert "known_fire" not in CriticState(small_world()).names


def test_threat_is_not_told_of_what_may_not_be_known():
    state, world = drawn(Sight(radius=2), "aTTTT TTTTT TTTTT TTTTT TTTTT", [(1, 1), (4, 4)])
    one = torch.ones_like(state.cells, dtype=torch.float32)
    risky = Forecast(expected_ignitions=one, ignition_probability=one * 0.0, fuel=one)
    assert not Local(channels=("threat",))(state, world, risky)["view"].any()
    full = state.without_planes("sensing")
    assert Local(channels=("threat",))(full, small_world(), risky)["view"].any()
