"""On the page: the fire, what its team believes of it, or both."""

import threading

import numpy as np
import pytest

pytest.importorskip("viser", reason="needs the extra live")

from tests.live.browser import Browser, until
from tests.live.conftest import SMALL
from tests.world.mechanics.there import needs
from warp_torchrl.live.address import Address
from warp_torchrl.live.episode import Film
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.page import Page
from warp_torchrl.world.state.cells import is_burning

BELIEVES = ("scenario=search", "belief=ensemble", "belief.members=2", "belief.hidden=4", *SMALL)
pytestmark = needs("belief", "radio", "sensing")


@pytest.fixture
def page(request, tmp_path):
    overrides = getattr(request, "param", BELIEVES)
    with Page(Setting(policy="noop", overrides=overrides), Address(port=0), tmp_path / "people") as made:
        yield made


def tiles(page):
    return page._stages[0].tiles.batched_colors.copy()


def test_a_team_with_beliefs_is_shown_under_its_veil_until_someone_chooses(page):
    both = tiles(page)
    assert page.view == "both"
    page.set_view("truth")
    truth = tiles(page)
    page.set_view("belief")
    belief = tiles(page)
    assert all((one != other).any() for one, other in ((both, truth), (truth, belief), (belief, both)))
    with pytest.raises(ValueError, match="view must be one of truth, belief, both, got all"):
        page.set_view("all")
    page.step()
    assert page.view == "belief", "it stays"


def test_flames_of_a_belief_stand_where_the_team_thinks_that_it_burns(page):
    side = page.match.sides[0]

    def flames():
        return int((page._stages[0]._flames._handle.batched_scales[:, 2] > 0.01).sum())

    page.set_view("truth")
    assert flames() == int(is_burning(side.state.cells).sum())
    page.set_view("belief")
    assert flames() == int(is_burning(side.world.assumed(side.state).cells).sum())


def test_a_browser_chooses_a_view_for_everybody_and_none_that_is_not_offered(page):
    clock = threading.Thread(target=page.play)
    clock.start()
    one, other = (Browser(page.address.port, page.address.token) for _ in range(2))
    one.set("Shown", "all")
    until(lambda: one.told)
    assert one.told[0].startswith("Shown must be one of truth, belief, both, got all") and page.view == "both"
    one.set("Shown", "truth")
    until(lambda: page.view == "truth" and other.value("Shown") == "truth")
    one.close(), other.close()
    page.stop()
    clock.join(timeout=10)


@pytest.mark.parametrize("page", [(*SMALL, "observation.radius=4")], indirect=True)
def test_where_agents_see_all_there_is_the_truth_alone(page):
    truth = tiles(page)
    page.set_view("belief")
    assert (tiles(page) == truth).all()
    clock = threading.Thread(target=page.play)
    clock.start()
    one = Browser(page.address.port, page.address.token)
    assert one.controls[one.find("Shown")]["props"]["disabled"]
    one.close()
    page.stop()
    clock.join(timeout=10)


def test_an_episode_as_a_file_shows_beliefs_and_says_what_they_are():
    match = Match(Setting(policy="noop", overrides=BELIEVES))
    film = Film(match.sides, ["noop"])
    assert film.view == "both"
    film.add()
    shown = film._stages[0].tiles.batched_colors.copy()
    film.view = "truth"
    film.add()
    assert not np.array_equal(film._stages[0].tiles.batched_colors, shown)
    film.view = "both"
    assert "thought to burn" in film.document()
