"""What the page says."""

import html
import re
from pathlib import Path

import pytest

from warp_torchrl.demonstrations.summary import Summary
from warp_torchrl.live import words
from warp_torchrl.live.crew import Question
from warp_torchrl.live.order import Order


@pytest.fixture
def match(make_match):
    return make_match("default", ("team.tank=8",), beside="local")


def test_the_headline_tells_the_step_of_the_side_that_is_farthest(match):
    match.step()
    assert words.headline(match) == "**default**, seed 1000000: step 1 of 30"
    while not match.ended:
        match.step()
    assert words.headline(match).endswith("of 30, over")


def test_the_table_has_a_row_for_each_side_with_its_numbers(match):
    rows = words.numbers_table(match).splitlines()
    assert rows[0] == "| | \u2003saved | \u2003burning | \u2003put\u00a0out | \u2003cleared |", "heads are apart"
    assert [row.split(" | ")[0].strip("| ") for row in rows[2:]] == [
        "default &#40;4.0 M&#41;",
        "local",
        "without a team",
    ]
    assert f"**{match.alone.curves.saved[-1]:.1%}**" in rows[-1]


def test_a_long_path_is_cut_at_its_front(match):
    match.sides[1].player.name = "outputs/2026-01-01/10-00-00-12345"
    assert words.title(match.sides[1]) == "...26-01-01/10-00-00-12345"


def test_the_table_of_vehicles_tells_who_moves_each_and_its_water(match):
    side = match.sides[0]
    side.crew.take(1, person=5)
    side.crew.order(2, Order(row=3, column=4, radius=2))
    rows = words.acts(side).splitlines()[2:]
    assert [row.split(" | ")[1] for row in rows] == ["policy", "a person", "policy, sent to 3, 4 (within 2)"]
    assert all("8 of 8" in row for row in rows)
    assert words.moved_by(side, 1, person=5) == "you" and words.moved_by(side, 1, person=6) == "a person"


def test_bars_are_as_long_as_the_probabilities_and_closed_actions_say_so(match):
    match.step()
    side = match.sides[0]
    bars = [float(each) for each in re.findall(r"width:([\d.]+)%'></div>", words.actions(side, 0))]
    assert bars == pytest.approx([100 * share for share in side.chances[0].tolist()], abs=0.06)
    assert words.actions(side, 0).count("closed") == int((~side.mask[0]).sum())


def test_a_policy_without_probabilities_says_so(match):
    match.step()
    assert "no action probabilities" in words.actions(match.sides[1], 0)


def test_what_an_agent_is_told_leaves_out_noughts():
    assert words.numbers_html({"time_left": 0.5, "tank": 0.0}).count("<b>") == 1
    assert "nothing else" in words.numbers_html({"tank": 0.0})


def test_the_legend_names_every_kind_of_cell_and_every_vehicle(match):
    text = words.legend(match.sides[0])
    for name in ("lake", "forest", "fire", "ash", "firebreak", "wet", "bulldozer_2"):
        assert f"</span>{name}</span>" in text


def test_a_question_names_the_vehicle_and_the_act_and_tells_how_unsure_the_policy_is(match):
    north, extinguish = (match.sides[0].env.action_names.index(name) for name in ("north", "extinguish"))
    text = words.questions(match.sides[0], [Question(0, extinguish), Question(2, extinguish)])
    assert text == "**bulldozer_0** is about to **extinguish**.\n\n**bulldozer_2** is about to **extinguish**."
    unsure = words.questions(match.sides[0], [Question(1, north, 0.312)])
    assert "What should **bulldozer_1** do?" in unsure and "**north**" in unsure and "31%" in unsure
    assert words.questions(match.sides[0], []) == ""


@pytest.mark.parametrize(
    ("names", "short"),
    [
        (["bulldozer_0", "bulldozer_10"], ["B0", "B10"]),
        (["bulldozer_0", "drone_0", "drone_1"], ["B0", "D0", "D1"]),
        (["drone_0", "dozer_0"], ["Dr0", "Do0"]),
    ],
)
def test_short_names_are_of_one_vehicle_each(names, short):
    assert words.labels(names) == short


def test_what_was_played_so_far_tells_whose_acts_there_were(match):
    side = match.sides[0]
    assert words.so_far(side) == "**0** steps so far, **0** acts of people, no corrections."
    side.crew.take(0, person=1)
    for name in ("stay", "south"):
        side.crew.press(0, 1, side.env.action_names.index(name))
        match.step()
    assert (
        words.so_far(side)
        == f"**2** steps so far, **2** acts of people, {side.open_recording.corrections} of them corrections."
    )


def test_recordings_are_a_table_in_which_a_broken_one_is_called_so():
    row = Summary("one", "skirmish", 7, "default", 30, 5, 2, 0.613)
    text = words.recordings(Path("people"), {"one": row, "two": "its sha256 is not its own"})
    assert text.splitlines()[-2:] == ["| one | 30 | 5 | 2 | 61% |", "| two | broken | | | |"]
    many = words.recordings(Path("people"), {f"{at:02}": row for at in range(20)})
    assert "| 19 |" in many and "| 04 |" not in many and many.endswith("and 5 before them.")
    assert words.recordings(Path("people"), {}) == "**people** holds no recording."


def test_a_training_tells_what_can_be_played():
    assert words.training("", None).startswith("Only policies")
    assert words.training("runs/a trains", None) == "runs&#47;a trains."
    assert words.training("runs/a trains", 2000) == "runs&#47;a trains. A policy of 2,000 steps can be played."


MARKUP = "<b>{1}|`[a](x)"


def test_names_of_others_are_text_wherever_they_are_shown(match, monkeypatch):
    side = match.sides[0]
    monkeypatch.setattr(side.env, "agent_names", [f"{MARKUP}_{agent}" for agent in range(3)])
    monkeypatch.setattr(side.env, "action_names", [f"{MARKUP}{name}" for name in side.env.action_names])
    match.scenario, side.player.name = MARKUP, f"\x1b[31m{MARKUP}\u202e"
    row = Summary(MARKUP, MARKUP, 7, MARKUP, 30, 5, 2, 0.613)
    texts = {
        "headline": (words.headline(match), 1),
        "numbers": (words.numbers_table(match), 1),
        "acts": (words.acts(side), 3),
        "questions": (words.questions(side, [Question(0, 1), Question(1, 2, 0.3)]), 4),
        "actions": (words.actions(side, 0), len(side.env.action_names)),
        "told": (words.numbers_html({MARKUP: 1.0}), 1),
        "legend": (words.legend(side), 3),
        "recordings": (words.recordings(Path(MARKUP), {MARKUP: row, f"{MARKUP}2": "broken"}), 3),
        "no recordings": (words.recordings(Path(MARKUP), {}), 1),
        "training": (words.training(f"{MARKUP} trains", 5), 1),
    }
    for name, (text, count) in texts.items():
        assert MARKUP not in text and html.unescape(text).count(MARKUP) == count, name
        assert not re.search(r"[{}`\x1b\u202e]|\[a", text), name
    assert words.title(side) == f"{MARKUP} (4.0 M)", "plain, for what is no markup"


def test_recordings_that_are_left_out_for_their_names_are_counted():
    told = "3 left out: names have letters, digits, ., \\_ and - alone."
    row = Summary("one", "skirmish", 7, "default", 30, 5, 2, 0.613)
    assert words.recordings(Path("people"), {}, 3).endswith(f"\n\n{told}")
    assert words.recordings(Path("people"), {"one": row}, 3).endswith(f"\n\n{told}")
    assert "left out" not in words.recordings(Path("people"), {"one": row})
