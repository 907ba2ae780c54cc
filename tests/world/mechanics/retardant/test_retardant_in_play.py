"""Aircraft with retardant in play: what they see, and the option that makes them."""

import pytest

from tests.runs.config.test_conf import composed
from tests.world.mechanics.there import needs
from warp_torchrl import make_env
from warp_torchrl.models import LOGITS, Mlp, signature
from warp_torchrl.runs.config.construction import build
from warp_torchrl.world.mechanics.retardant.retardant import RetardantTeam


def test_networks_read_it_north_up():
    env = make_env("haksar", n_worlds=2, overrides=["observation=at_fire", "landscape.size=16"])
    assert Mlp(symmetry="none").actor(signature(env))(env.reset())[LOGITS].shape == (2, 10, 11)
    with pytest.raises(ValueError, match="symmetry"):
        Mlp().actor(signature(env))


@needs("sensing")
def test_it_is_refused_where_agents_do_not_see_all():
    with pytest.raises(ValueError, match="sensing must be full with observation=at_fire"):
        make_env("haksar", n_worlds=1, overrides=["observation=at_fire", "sensing=sight"])


def test_the_team_without_arguments_is_its_option():
    assert build(composed("team", "retardant"), "team") == RetardantTeam()
