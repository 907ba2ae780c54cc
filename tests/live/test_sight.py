"""What one agent sees."""

import numpy as np
import pytest

from warp_torchrl.live import sight


@pytest.fixture
def side(make_match):
    return make_match("default").sides[0]


def test_every_map_of_the_observation_is_a_picture_with_all_its_channels(side):
    pictures = sight.pictures(side, 0, tile=20)
    assert set(pictures) == {"view", "picture"}
    # 11 channels, four beside each other: three rows of 20 + 4 pixels and a name of 13.
    assert pictures["view"].shape == (3 * 37, 4 * 24, 3) and pictures["picture"].shape == (37, 3 * 24, 3)


def test_a_channel_is_dark_where_it_shows_its_least_and_bright_where_it_shows_its_most(side):
    view = sight.entries(side, 0)["view"]
    names = side.env.channel_names["view"]
    at = names.index("off_map")
    view[at] = 0
    view[at, 0, 0] = 255
    view[at, 0, -1] = 51
    picture = sight.pictures(side, 0, tile=70)["view"]
    row, column = at // 4 * (74 + 13) + 13, at % 4 * 74
    assert picture[row + 3, column + 3].sum() > 700 and picture[row + 66, column + 66].sum() < 120
    # A fifth of the way from the darkest colour: four fifths towards the second of five, (92, 44, 110).
    assert picture[row + 3, column + 66].tolist() == [77, 39, 95]


def test_numbers_have_their_names(side):
    told = sight.named_numbers(side, 1)
    seen = sight.entries(side, 1)["status"]
    assert list(told) == list(side.env.channel_names["status"]) and np.allclose(list(told.values()), seen)
    assert told["time_left"] == 1.0


def test_the_flat_view_of_the_paper_has_neither_maps_nor_names(make_match):
    side = make_match("local", ("observation=paper",)).sides[0]
    assert sight.pictures(side, 0) == {} and sight.named_numbers(side, 0) == {}
