"""Who moves each vehicle."""

import pytest
import torch

from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.live.crew import MOST_KEYS, Crew, Question, Refused
from warp_torchrl.live.order import Order
from warp_torchrl.world.state.state import Action
from warp_torchrl.world.team.team import Team

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


# Where the policy is unsure


def likely(*tops):
    """Probabilities of which the likeliest action has these."""
    chances = torch.zeros(len(tops), 11)
    chances[:, 0], chances[:, 1] = torch.tensor(tops), 1.0 - torch.tensor(tops)
    return chances


def asked(crew, *tops):
    return [each.agent for each in crew.questions(POLICY, likely(*tops))]


def decided(crew, possible=OPEN):
    action, movers, told = crew.decide(POLICY, possible, possible, PLACE)
    return action.tolist(), movers, told


def test_the_vehicle_whose_policy_is_least_sure_is_asked_about_first(crew):
    assert asked(crew, 0.6, 0.55) == [], "nobody wants to be asked"
    crew.ask_where_unsure(0.7)
    assert asked(crew, 0.6, 0.55) == [1, 0] and asked(crew, 0.6, 0.75) == [0] and asked(crew, 0.9, 0.8) == []
    assert crew.questions(POLICY, likely(0.6, 0.9)) == [Question(0, EXTINGUISH, pytest.approx(0.6))]
    assert crew.questions(POLICY, None) == [], "a baseline has no probabilities"


def test_what_a_person_chooses_is_done_and_is_the_person_s(crew):
    crew.ask_where_unsure(1.0)
    first, second = crew.questions(POLICY, likely(0.6, 0.7))
    crew.choose(first, CLEAR, OPEN)
    assert asked(crew, 0.6, 0.7) == [1]
    crew.answer(second, True)
    assert asked(crew, 0.6, 0.7) == []
    action, movers, _ = decided(crew)
    assert action == [CLEAR, int(Action.EAST)]
    assert movers == [Mover.PERSON, Mover.PERSON], "an act that was asked for and approved is the person's too"
    assert asked(crew, 0.6, 0.7) == [0, 1], "a choice is of one step"


def test_an_unsure_policy_may_be_forbidden_what_it_proposes(crew):
    crew.ask_where_unsure(0.65)
    crew.answer(crew.questions(POLICY, likely(0.6, 0.9))[0], False)
    assert asked(crew, 0.6, 0.9) == []
    action, movers, _ = decided(crew)
    assert action == [STAY, int(Action.EAST)] and movers == [Mover.FORBIDDEN, Mover.POLICY]


def test_a_choice_that_would_do_nothing_is_refused_and_the_question_stays(crew):
    closed = OPEN.clone()
    closed[0, CLEAR] = False
    crew.ask_where_unsure(0.65)
    question = crew.questions(POLICY, likely(0.6, 0.9))[0]
    with pytest.raises(Refused, match="bulldozer_0: clear would do nothing here"):
        crew.choose(question, CLEAR, closed)
    assert asked(crew, 0.6, 0.9) == [0]
    crew.choose(question, STAY, closed)
    crew.choose(question, CLEAR, OPEN)  # and then the world changed
    assert decided(crew, closed) == (
        [STAY, int(Action.EAST)], [Mover.WAITING, Mover.POLICY], ["bulldozer_0: clear would do nothing here"]
    )  # fmt: skip


def test_a_vehicle_is_asked_about_once_and_a_driven_one_not_at_all(crew):
    crew.ask_where_unsure(1.0)
    crew.ask_before(["extinguish", "east"])
    assert [each.chance is None for each in crew.questions(POLICY, likely(0.6, 1.0))] == [False, True]
    crew.take(0, ANN)
    assert crew.questions(POLICY, likely(0.6, 1.0)) == [Question(1, int(Action.EAST))]


def test_what_is_no_probability_is_refused(crew):
    with pytest.raises(Refused, match="a probability must be in"):
        crew.ask_where_unsure(1.5)
    crew.ask_where_unsure(0.5)
    crew.ask_where_unsure(None)
    assert crew.unsure_below is None
