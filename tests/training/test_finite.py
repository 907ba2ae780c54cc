"""No step is taken with numbers that are not finite, whether the device is asked at each or once a batch."""

import pytest
import torch

from warp_torchrl.system.device import unread
from warp_torchrl.training.finite import FiniteSteps, NumericalFailure

INF, NAN = float("inf"), float("nan")


def stepped(losses, norms):
    """The weight after steps with gradient 1, the optimiser's count of steps, and its failure."""
    weight = torch.nn.Parameter(torch.ones(2))
    optimizer = torch.optim.Adam([weight], lr=0.1, fused=True)
    steps, failure = FiniteSteps(optimizer), None
    try:
        for loss, norm in zip(losses, norms, strict=True):
            weight.grad = torch.full((2,), norm)
            steps.take(torch.tensor(loss), torch.tensor(norm), frames=7)
        told = steps.read({"loss": torch.tensor(2.0)}, frames=7)
        assert told == {"loss": 2.0}
    except NumericalFailure as error:
        failure = str(error)
    counts = [int(state["step"]) for state in optimizer.state.values()]
    return weight.detach(), counts, failure


def test_finite_steps_are_the_optimisers():
    expected = stepped([1.0, 0.5], [1.0, 2.0])
    with unread():
        found = stepped([1.0, 0.5], [1.0, 2.0])
    assert torch.equal(found[0], expected[0]) and (found[0] < 1.0).all() and found[1:] == expected[1:] == ([2], None)


@pytest.mark.parametrize(("loss", "norm"), [(INF, 1.0), (1.0, INF), (NAN, 1.0), (1.0, NAN)])
def test_from_the_first_strange_number_on_the_weights_stay(loss, norm):
    expected = stepped([1.0, loss], [1.0, norm])
    with unread():
        found = stepped([1.0, loss, 0.5], [1.0, norm, 1.0])
    assert torch.equal(found[0], expected[0]) and found[1] == [1]
    assert found[2] == expected[2] and f"the loss, {loss:g}, or its gradient, of norm {norm:g}" in found[2]
    assert found[2].startswith("after 7 frames")


def test_a_refusal_is_told_once():
    steps = FiniteSteps(torch.optim.Adam([torch.nn.Parameter(torch.ones(1))], fused=True))
    with unread():
        steps.take(torch.tensor(INF), torch.tensor(1.0), frames=1)
        with pytest.raises(NumericalFailure):
            steps.read({}, frames=1)
        assert steps.read({}, frames=2) == {}
