"""What learners are shown of beliefs: channels of the view, blocks of the picture, planes of the critic's state."""

import pytest
import torch

from tests.conftest import small_world
from tests.world.mechanics.belief.drawing import believing
from tests.world.mechanics.belief.worlds import rules
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.entries import Empty
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.observation import CHANNELS, Local, Surroundings
from warp_torchrl.models import OBSERVATION, signature
from warp_torchrl.world.mechanics.belief.belief import Ensemble
from warp_torchrl.world.mechanics.belief.beliefs import NAME, beliefs_of

MAPS = ("burn_probability", "burn_soon", "disagreement", "hidden_fire")


def test_maps_of_a_belief_that_was_drawn():
    state = believing("TTTT", "aTTa", "TTTa", weights=[0.25, 0.75])
    soon, unseen = torch.tensor([[[[0.5, 0.2, 0.0, 1.0]]]]), torch.tensor([[[[1 / 3, 1 / 3, 1 / 3, 0.0]]]])
    state = state.with_planes(NAME, beliefs_of(state).replace(soon=soon, unseen=unseen))
    shown = {name: Ensemble.maps[name](state).flatten().tolist() for name in MAPS}
    assert shown == {
        "burn_probability": [63, 0, 0, 255],  # 255 / 4
        "burn_soon": [127, 51, 0, 255],
        "disagreement": [191, 0, 0, 0],  # 255 * 4 / 4 * 3 / 4
        "hidden_fire": [147, 147, 147, 0],  # 255 / sqrt(3)
    }


def env_of(belief=None, of="team", **options):
    """An environment in which the first agent sees a quarter of a forest."""
    world = rules(radius=5, size=32, belief=belief or Ensemble(of=of, members=2, hidden=6), shares=of == "team")
    return WildfireEnv(world, observation=Surroundings(features=MAPS, **options), n_worlds=2)


def planes_of(env, now, entry, name):
    """What is shown of a map in an entry, whole numbers over 255."""
    shown = now["state"] if entry == "state" else now[(*OBSERVATION, entry)]
    names = env.state_names if entry == "state" else env.channel_names[entry]
    plane = shown[:, names.index(name)] if entry == "state" else shown[:, :, names.index(name)]
    return plane if plane.is_floating_point() else plane / 255.0


@pytest.mark.parametrize("of", ["team", "agent"])
@pytest.mark.parametrize("name", MAPS)
def test_features_show_the_maps_in_view_picture_and_state(name, of):
    env = env_of(of=of, centred=False)
    now = env.reset()
    own = Ensemble.maps[name](env.world_state) / 255.0
    means = own.unflatten(-1, (8, 4)).unflatten(-3, (8, 4)).mean((-1, -3))
    each = means if of == "agent" else means[:, None].expand(-1, 2, -1, -1)
    torch.testing.assert_close(planes_of(env, now, "picture", name), each.sqrt())
    blocks = own.unflatten(-1, (16, 2)).unflatten(-3, (16, 2)).mean((-1, -3))
    torch.testing.assert_close(planes_of(env, now, "state", name), blocks.mean(1) if of == "agent" else blocks)
    view, (row, column) = planes_of(env, now, "view", name), env.world_state.vehicles.position[0, 0].tolist()
    middle = view.shape[-1] // 2
    assert view[0, 0, middle, middle] == (own[0, 0] if of == "agent" else own[0])[row, column]


def test_worlds_without_a_belief_show_none_and_networks_leave_it_out():
    plain, env = (
        WildfireEnv(small_world(), observation=Surroundings(features=each), n_worlds=2) for each in ((), MAPS)
    )
    before, now = plain.reset()[OBSERVATION], env.reset()[OBSERVATION]
    for name in ("view", "picture"):
        assert env.channel_names[name] == (*plain.channel_names[name], *MAPS)
        assert torch.equal(now[name][:, :, :-4], before[name]) and not now[name][:, :, -4:].any()
        assert signature(env).observation[name].content[-4:] == (Empty(),) * 4
    assert signature(env).state.content[-5:-1] == (Empty(),) * 4


def test_a_channel_that_is_chosen_and_a_feature_too_is_shown_once():
    preset = Local(channels=("age", "burn_soon"), features=("hidden_fire", "burn_soon"))
    assert preset.view_names == ("age", "burn_soon", "hidden_fire")
    assert {*preset.view_names} <= {*CHANNELS}


@needs("radio", "sensing")
def test_the_option_shows_what_a_team_believes_in_any_scenario():
    over = ["observation=believed", "belief=ensemble", "belief.members=2", "belief.hidden=4"]
    env = make_env("scouts", n_worlds=1, overrides=over)
    assert env.channel_names["view"][-5:] == ("last_seen", *MAPS) and env.channel_names["picture"][-4:] == MAPS
    assert planes_of(env, env.reset(), "picture", "hidden_fire").any()
