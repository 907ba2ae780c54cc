"""A scripted person: late, at times wrong, and with one keyboard."""

import pytest
import torch

from warp_torchrl.demonstrations.scripted import Person, ScriptedPerson

OPEN = torch.ones(2, 4, dtype=torch.bool)


def sure(*of_agents):
    """Probabilities of four acts of each agent, of which the first is the likeliest."""
    return torch.tensor([[each, *[(1.0 - each) / 3] * 3] for each in of_agents])


def driven(person, steps, advice=lambda step: [step % 4, 3]):
    """Vehicle and act of each step, of policies that are as sure as ``steps`` says."""
    scripted = ScriptedPerson(person, seed=3)
    found = []
    for step, chances in enumerate(steps):
        act = scripted.drive(sure(*chances), torch.tensor(advice(step)), OPEN)
        found.append((scripted.agent, act))
    return found


def test_they_do_what_they_saw_fit_some_steps_ago():
    person = Person(delay=2, error=0.0, threshold=0.6)
    assert driven(person, [(0.3, 0.9)] * 6) == [(0, None), (0, None), (0, 0), (0, 1), (0, 2), (0, 3)]
    assert driven(Person(delay=0, error=0.0, threshold=0.6), [(0.3, 0.9)] * 2) == [(0, 0), (0, 1)]


def test_they_take_over_who_is_least_sure_and_one_at_a_time():
    person = Person(delay=0, error=0.0, threshold=0.6)
    unsure = [(0.9, 0.7), (0.5, 0.4), (0.3, 0.5), (0.5, 0.6), (0.7, 0.8)]
    assert [agent for agent, _ in driven(person, unsure)] == [None, 1, 1, 0, None]


def test_a_new_vehicle_waits_for_them_anew():
    person = Person(delay=1, error=0.0, threshold=0.6)
    acts = driven(person, [(0.3, 0.9), (0.3, 0.9), (0.9, 0.3), (0.9, 0.3)])
    assert acts == [(0, None), (0, 0), (1, None), (1, 3)]


def test_a_vehicle_that_can_do_nothing_needs_nobody():
    nothing = torch.tensor([[False] * 4, [True] * 4])
    scripted = ScriptedPerson(Person(delay=0, error=0.0, threshold=0.6), 0)
    scripted.drive(torch.tensor([[0.0] * 4, [0.5, 0.3, 0.1, 0.1]]), torch.tensor([0, 0]), nothing)
    assert scripted.agent == 1


def test_so_many_of_their_acts_are_random_and_open():
    only = torch.tensor([[False, True, False, True]])
    scripted = ScriptedPerson(Person(delay=0, error=0.25, threshold=1.0), 5)
    acts = [scripted.drive(torch.full((1, 4), 0.25), torch.tensor([2]), only) for _ in range(4000)]
    wrong = [each for each in acts if each != 2]
    assert 0.22 < len(wrong) / len(acts) < 0.28, "0.25, of which none happens to be the baseline's"
    assert set(wrong) == {1, 3}


def test_errors_are_those_of_the_seed():
    def acts(seed):
        scripted = ScriptedPerson(Person(delay=0, error=0.5, threshold=1.0), seed)
        return [scripted.drive(sure(0.5, 0.9), torch.tensor([0, 0]), OPEN) for _ in range(40)]

    assert acts(1) == acts(1) != acts(2)


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"by": "coordinatd"}, "by must be one of .*coordinated.*did you mean coordinated"),
        ({"by": "ring"}, "by must be one of"),
        ({"delay": -1}, "delay must be in"),
        ({"error": 1.5}, "error must be in"),
        ({"threshold": float("nan")}, "threshold must be"),
    ],
)
def test_what_nobody_can_be_is_refused(values, said):
    with pytest.raises(ValueError, match=said):
        Person(**values)
