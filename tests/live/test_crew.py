"""Who moves each vehicle."""

import pytest
import torch

from warp_torchrl.live.crew import MOST_KEYS, Crew, Question, Refused
from warp_torchrl.live.order import Order
from warp_torchrl.world.state import Action
from warp_torchrl.world.team import Team

ANN, BOB = 7, 8
OPEN = torch.ones(2, 11, dtype=torch.bool)
PLACE = torch.tensor([[4, 4], [4, 5]])
EXTINGUISH, CLEAR, STAY = int(Action.EXTINGUISH), int(Action.CLEAR), int(Action.STAY)
POLICY = torch.tensor([EXTINGUISH, int(Action.EAST)])


@pytest.fixture
def crew():
    return Crew(Team(n_agents=2))


def acts(crew, possible=OPEN, proposed=POLICY):
    action, _, told = crew.decide(proposed, crew.mask(possible, PLACE), possible, PLACE)
    return action.tolist(), told


def test_without_people_the_policy_moves_all(crew):
    assert acts(crew) == (POLICY.tolist(), [])


def test_a_driven_vehicle_does_its_acts_in_order_one_a_step_then_idles(crew):
    crew.take(0, ANN)
    crew.press(0, ANN, int(Action.NORTH))
    crew.press(0, ANN, CLEAR)
    done = [acts(crew)[0] for _ in range(3)]
    assert done == [[int(Action.NORTH), int(Action.EAST)], [CLEAR, int(Action.EAST)], [STAY, int(Action.EAST)]]


def test_an_act_that_the_mask_closes_is_refused_with_a_line_and_is_not_done(crew):
    closed = OPEN.clone()
    closed[0, CLEAR] = False
    crew.take(0, ANN)
    crew.press(0, ANN, CLEAR)
    assert acts(crew, closed) == ([STAY, int(Action.EAST)], ["bulldozer_0: clear would do nothing here"])


def test_two_people_cannot_drive_one_vehicle_and_the_first_keeps_it(crew):
    crew.take(0, ANN)
    with pytest.raises(Refused, match="bulldozer_0 is driven by another person"):
        crew.take(0, BOB)
    for attempt in (lambda: crew.press(0, BOB, CLEAR), lambda: crew.hand_back(0, BOB)):
        with pytest.raises(Refused, match="not yours"):
            attempt()
    assert crew.seats[0].person == ANN and not crew.seats[0].keys


def test_what_is_handed_back_is_the_policy_s(crew):
    crew.take(0, ANN)
    crew.press(0, ANN, CLEAR)
    crew.hand_back(0, ANN)
    assert acts(crew)[0] == POLICY.tolist()


def test_who_leaves_gives_back_all_that_was_theirs_and_nothing_else(crew):
    crew.take(0, ANN)
    crew.take(1, BOB)
    assert crew.leave(ANN) == ["bulldozer_0"] and crew.leave(ANN) == []
    assert [seat.person for seat in crew.seats] == [None, BOB]


def test_keys_that_would_be_done_much_later_are_refused(crew):
    crew.take(0, ANN)
    for _ in range(MOST_KEYS):
        crew.press(0, ANN, STAY)
    with pytest.raises(Refused, match="acts to do first"):
        crew.press(0, ANN, STAY)


def test_the_policy_waits_for_a_word_before_an_act_that_is_asked_for(crew):
    crew.ask_before(["extinguish"])
    asked = [Question(0, EXTINGUISH)]
    assert crew.questions(POLICY) == asked
    crew.answer(asked[0], True)
    assert crew.questions(POLICY) == [] and acts(crew)[0] == POLICY.tolist()
    assert crew.questions(POLICY) == asked, "a word is of one step"


def test_an_act_that_is_forbidden_is_not_done(crew):
    crew.ask_before(["extinguish"])
    crew.answer(Question(0, EXTINGUISH), False)
    assert acts(crew)[0] == [STAY, int(Action.EAST)]


def test_nobody_is_asked_about_their_own_acts(crew):
    crew.ask_before(["extinguish"])
    crew.take(0, ANN)
    assert crew.questions(POLICY) == []


def test_a_kind_of_act_that_the_team_has_not_is_refused(crew):
    with pytest.raises(Refused, match="got extinguisch: did you mean extinguish"):
        crew.ask_before(["extinguisch"])


def test_an_order_masks_one_vehicle_alone(crew):
    crew.order(0, Order(row=4, column=9, radius=1))
    mask = crew.mask(OPEN, PLACE)
    assert mask[0].nonzero()[:, 0].tolist() == [1, 2, 3, EXTINGUISH] and mask[1].all()


def test_a_baseline_that_does_not_read_the_mask_goes_where_it_is_sent(crew):
    crew.order(1, Order(row=4, column=0, radius=1))
    assert acts(crew)[0] == [EXTINGUISH, int(Action.WEST)], "it had proposed east"


def test_within_its_sector_a_baseline_that_would_leave_moves_within(crew):
    crew.order(1, Order(row=4, column=5, radius=0))  # it is there: every move leads out
    assert acts(crew)[0] == [EXTINGUISH, STAY]


def test_a_person_takes_no_order_and_ends_one(crew):
    crew.order(0, Order(row=0, column=0))
    crew.take(0, ANN)
    assert crew.seats[0].order is None
    with pytest.raises(Refused, match="takes no order"):
        crew.order(0, Order(row=0, column=0))


def test_a_new_start_forgets_keys_and_words_but_no_seats(crew):
    crew.take(0, ANN)
    crew.press(0, ANN, CLEAR)
    crew.ask_before(["clear"])
    crew.answer(Question(1, CLEAR), True)
    crew.restart()
    assert crew.seats[0].person == ANN and not crew.seats[0].keys
    assert crew.questions(torch.tensor([STAY, CLEAR])) == [Question(1, CLEAR)]
