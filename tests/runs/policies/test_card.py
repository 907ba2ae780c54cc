"""A card says how a policy was trained, and where it is behind; names of strangers are no markup."""

from dataclasses import replace

import pytest

from warp_torchrl.runs.checkpoint import newest
from warp_torchrl.runs.history import UNKNOWN, Stage, Teacher, trained_steps
from warp_torchrl.runs.measured import Measured, Share
from warp_torchrl.runs.policies.card import CARD, card
from warp_torchrl.runs.policies.find import find_policy
from warp_torchrl.system.shipped import policy_names


def changed(**fields):
    """The shipped policy ``single`` with another manifest."""
    found = newest(find_policy("single"))[0]
    return replace(found, manifest=replace(found.manifest, **fields))


@pytest.mark.parametrize("name", policy_names())
def test_a_shipped_policy_has_the_card_of_its_manifest(name):
    """After a change: ``warp export NAME > docs/policies/NAME/README.md``."""
    found = newest(find_policy(name))[0]
    assert (found.path / CARD).read_text(encoding="utf-8") == card(found, name)
    assert found.manifest.history and found.manifest.measured


def test_the_generalist_was_trained_seven_times():
    history = newest(find_policy("generalist"))[0].history
    steps = (3_407_872, 1_310_720, 901_120, 540_672, 507_904, 0, 409_600, 393_216)
    assert tuple(stage.steps for stage in history) == steps and trained_steps(history) == 7_471_104
    assert history[5].parents == (history[4].key, history[1].key)
    told = card(newest(find_policy("generalist"))[0], "generalist")
    assert "7,471,104 world steps in 7 trainings; taught by dispatch, generalist, single, skirmish" in told
    assert "`single` (1,007,616 steps)" in told and "The baseline" not in told.partition("## Use")[0]


def test_where_it_is_surely_behind_a_baseline_is_where_it_fails():
    share = {"low": -0.05, "high": -0.01, "mean": -0.03}
    gaps = {"local": Share(**share), "noop": Share(**share | {"high": 0.01})}
    result = Measured(
        worlds="ring",
        fires=8,
        first_seed=5,
        metric="saved",
        reached=Share(mean=0.5, low=0.4, high=0.6),
        differences=gaps,
    )
    told = card(changed(measured=(result,)), "mine")
    assert "- Behind the baseline `local` on `ring`: -3.0 (-5.0 .. -1.0) points." in told
    assert "Behind the baseline `noop`" not in told
    assert "| `ring` | 8 from 5 | saved | 50.0 (40.0 .. 60.0) | -3.0 (-5.0 .. -1.0) | -3.0 (-5.0 .. +1.0) |" in told
    assert "No evaluation is on record" in card(changed(measured=()), "mine")


def test_names_of_strangers_are_no_markup():
    stage = Stage(
        key="a",
        steps=3,
        worlds="`x` | [link](http://a) <b>",
        algorithm="mappo",
        teachers=(Teacher(name="![i](j)"),),
        parents=(UNKNOWN,),
    )
    told = card(changed(history=(stage,)), "mine <script>")
    assert not any(each in told for each in ("<script>", "<b>", "[link]", "![i]", "`x`"))
    assert "| 1 | `x link (http://a) b` | 3 | `mappo` | a policy without a record |" in told
