"""Trained weights go by the names of what they read."""

import pytest
import torch
from tensordict import TensorDict

from warp_torchrl.models import LOGITS, OBSERVATION, Cnn, Entry, Mlp, Signature
from warp_torchrl.models.matching import differences, matched

VIEW, STATUS = ("fire", "fuel", "mates"), ("row", "column", "wind")
MODELS = [
    Mlp(symmetry="none", dtype="float32", actor_hidden=(8, 8)),
    Cnn(symmetry="none", actor_hidden=(8,), channels=(4, 4)),
]


def seen_by(view, status):
    entries = {"status": Entry((len(status),), "float32", status), "view": Entry((len(view), 5, 5), "uint8", view)}
    return Signature(entries, Entry((1, 5, 5), "uint8"), 2, ("stay", "north"), ("ugv",))


def look(view, status):
    """What two agents of three worlds see: by name always the same."""
    maps, numbers = torch.Generator().manual_seed(1), torch.Generator().manual_seed(2)
    planes = dict(zip((*VIEW, "seen"), torch.randint(0, 256, (4, 3, 2, 5, 5), generator=maps), strict=True))
    told = dict(zip((*STATUS, "hours"), torch.randn((4, 3, 2), generator=numbers), strict=True))
    return {
        "status": torch.stack([told[name] for name in status], dim=-1),
        "view": torch.stack([planes[name] for name in view], dim=-3).to(torch.uint8),
    }


def logits(model, signature, parameters, given):
    actor = model.actor(signature)
    actor.load_state_dict(parameters)
    return actor(TensorDict({OBSERVATION: given}, [3]))[LOGITS]


@pytest.mark.parametrize("model", MODELS, ids=["mlp", "cnn"])
@pytest.mark.parametrize(
    ("view", "status"),
    [
        ((*VIEW, "seen"), ("hours", *STATUS)),
        (("seen", *VIEW), (*STATUS, "hours")),
        (VIEW[::-1], STATUS[::-1]),
        (VIEW, (*STATUS, "hours")),
    ],
)
def test_a_policy_does_the_same_among_further_channels_and_in_another_order(model, view, status):
    trained, here = (seen_by(VIEW, STATUS), seen_by(view, status))
    theirs, ours = model.actor(trained), model.actor(here)
    given = matched(theirs.state_dict(), theirs, ours)
    before = logits(model, trained, theirs.state_dict(), look(VIEW, STATUS))
    assert torch.allclose(logits(model, here, given, look(view, status)), before, atol=1e-5)
    assert before.std() > 0.0


@pytest.mark.parametrize("model", MODELS, ids=["mlp", "cnn"])
def test_what_is_no_longer_seen_counts_as_nothing(model):
    trained, here = seen_by(VIEW, STATUS), seen_by(VIEW[:2], STATUS[1:])
    theirs, ours = model.actor(trained), model.actor(here)
    given = matched(theirs.state_dict(), theirs, ours)
    dark = look(VIEW, STATUS)
    dark["view"][..., 2, :, :], dark["status"][..., 0] = 0, 0.0
    before = logits(model, trained, theirs.state_dict(), dark)
    assert torch.allclose(logits(model, here, given, look(VIEW[:2], STATUS[1:])), before, atol=1e-5)
    assert differences(theirs, ours) == ([], ["mates", "row"])
    assert differences(ours, theirs) == (["mates", "row"], [])


def test_other_layers_and_maps_of_another_size_stay_as_they_are():
    model, trained = MODELS[0], seen_by(VIEW, STATUS)
    large = Entry((4, 7, 7), "uint8", (*VIEW, "seen"))
    here = trained._replace(observation={**trained.observation, "view": large})
    theirs = model.actor(trained)
    given = matched(theirs.state_dict(), theirs, model.actor(here))
    assert all(torch.equal(given[name], each) for name, each in theirs.state_dict().items())
