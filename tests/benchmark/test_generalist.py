"""One policy on every kind of fire, beside the best baseline of each."""

import json

import numpy as np
import pytest
from PIL import Image

from warp_torchrl import load_policy, make_env
from warp_torchrl.benchmark import __main__ as command
from warp_torchrl.benchmark import measures
from warp_torchrl.benchmark.generalist import PLACES, ScenarioVariant, generalist_table, on_ground, table_line
from warp_torchrl.benchmark.generalist_figure import draw_generalist
from warp_torchrl.evaluation.play import play, play_heuristics
from warp_torchrl.evaluation.statistics import compare, summarise
from warp_torchrl.runs.config.compose import compose_config

SMALL = ["horizon=12", "landscape.size=12"]
TWO = {"scenarios": (ScenarioVariant("skirmish", "skirmish"), ScenarioVariant("windy", "skirmish", ("wind.speed=9",)))}


def test_a_row_is_the_policy_beside_the_best_baseline_on_the_same_fires(capsys, monkeypatch):
    monkeypatch.setattr(measures, "PLACES", TWO)
    monkeypatch.setattr("warp_torchrl.benchmark.generalist.RIVALS", ("noop", "coordinated"))
    command.main(["generalist", "--policy", "skirmish", "--episodes", "4", "--json", "--set", *SMALL])
    printed = capsys.readouterr()
    rows = json.loads(printed.out)["generalist"]
    assert [row["place"] for row in rows] == ["skirmish", "windy"]
    assert printed.err.splitlines() == [table_line(row) for row in rows]  # each as soon as it is played
    policy = load_policy("skirmish")
    for row, more in zip(rows, ((), ("wind.speed=9",)), strict=True):
        env = make_env("skirmish", n_worlds=4, seed=1_000_000, overrides=[*policy.overrides, *more, *SMALL])
        own = play(env, policy, 1_000_000, policy.mode)["saved"]
        others = play_heuristics(env, 1_000_000, ("noop", "coordinated"))
        best = max(others, key=lambda name: others[name]["saved"].mean())
        assert row["rival"] == best
        assert row["policy"]["mean"] == pytest.approx(own.mean())
        assert row["difference"]["saved_difference"] == pytest.approx((own - others[best]["saved"]).mean())
        to_reference = (own - others["coordinated"]["saved"]).mean()
        assert row["to_reference"]["saved_difference"] == pytest.approx(to_reference)
        assert row["reference"]["mean"] == pytest.approx(others["coordinated"]["saved"].mean())
    assert rows[0]["policy"] != rows[1]["policy"]


def test_a_specialist_is_played_with_what_it_sees_on_the_same_fires(capsys, monkeypatch):
    monkeypatch.setattr(measures, "PLACES", {"specialists": (ScenarioVariant("skirmish", "skirmish", rival="single"),)})
    command.main(["generalist", "--policy", "skirmish", "--episodes", "4", "--json", "--set", *SMALL])
    (row,) = json.loads(capsys.readouterr().out)["generalist"]

    def saved(name):
        policy = load_policy(name)
        env = make_env("skirmish", n_worlds=4, seed=1_000_000, overrides=[*policy.overrides, *SMALL])
        return play(env, policy.fitted(env), 1_000_000, policy.mode)["saved"]

    own, theirs = saved("skirmish"), saved("single")
    assert row["rival"] == "specialist single"
    assert row["beside"]["mean"] == pytest.approx(theirs.mean())
    assert row["difference"]["saved_difference"] == pytest.approx((own - theirs).mean())
    assert row["difference"]["saved_difference"] != 0.0


@pytest.mark.parametrize("rival", [None, "single"])
def test_fires_that_do_not_fit_into_one_batch_play_in_parts(capsys, monkeypatch, rival):
    def rows(cells):
        monkeypatch.setattr("warp_torchrl.benchmark.generalist._CELLS", cells)
        command.main(["generalist", "--policy", "skirmish", "--episodes", "3", "--json", "--set", *SMALL])
        return json.loads(capsys.readouterr().out)["generalist"]

    made = []

    def making(*given, n_worlds, **more):
        made.append(n_worlds)
        return make_env(*given, n_worlds=n_worlds, **more)

    monkeypatch.setattr(measures, "PLACES", {"scenarios": (ScenarioVariant("skirmish", "skirmish", rival=rival),)})
    monkeypatch.setattr("warp_torchrl.benchmark.generalist.RIVALS", ("noop", "coordinated"))
    monkeypatch.setattr("warp_torchrl.benchmark.generalist.make_env", making)
    at_once = rows(3 * 12 * 12)
    assert max(made) == 3
    made.clear()
    assert rows(2 * 12 * 12) == at_once
    assert max(made) == 2
    if rival is not None:
        assert rows(1) == at_once  # a map that is larger than a batch plays alone


def test_one_row_of_a_group_is_played_alone(capsys, monkeypatch):
    monkeypatch.setattr(measures, "PLACES", TWO)
    monkeypatch.setattr("warp_torchrl.benchmark.generalist.RIVALS", ("coordinated",))
    command.main(["generalist", "--policy", "skirmish", "--places", "windy", "--episodes", "2", "--set", *SMALL])
    assert "| windy |" in (told := capsys.readouterr().out) and "| skirmish |" not in told


def test_the_table_counts_where_the_policy_is_surely_ahead_and_behind():
    saved = np.linspace(0.5, 0.7, 20)
    lower = saved - 0.15

    def row(place, own):
        found = {"policy": summarise(own), "rival": "ring", "beside": summarise(saved), "reference": summarise(lower)}
        differences = {"difference": compare(own, saved), "to_reference": compare(own, lower)}
        return {"place": place, "episodes": 20, **found, **differences}

    noise = np.where(np.arange(20) % 2, 0.1, -0.1)
    text = generalist_table([row("a", saved + 0.1), row("b", saved - 0.2), row("c", saved + noise)])
    assert "| a | 70.0 (" in text and "| ring | 60.0 (" in text and "| +10.0 (+10.0 .. +10.0) |" in text
    assert "| +10.0 (+10.0 .. +10.0) | +25.0 (+25.0 .. +25.0) |" in text
    assert text.endswith(
        "Of 3 places ahead of the rival, intervals apart, on 1, and behind it on 1; "
        "of `coordinated` on 2, and behind it on 1."
    )


@pytest.mark.parametrize(
    "place", [place for places in PLACES.values() for place in places], ids=lambda place: place.name
)
def test_every_place_is_one_of_ours(place):
    compose_config("train", [f"scenario={place.scenario}", *place.overrides])


def test_the_figure_has_a_row_for_each_place(tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra figures")

    def drawn(*saved):
        known = {"episodes": 9, "rival": "ring", "beside": summarise(np.array([0.1, 0.2]))}
        means = [summarise(np.linspace(mean - 0.05, mean + 0.05, 9)) for mean in saved]
        rows = [{"place": f"place {index}", "policy": mean, **known} for index, mean in enumerate(means)]
        draw_generalist(rows, tmp_path / "figure.png")
        return np.asarray(Image.open(tmp_path / "figure.png").convert("RGB"))

    def of_policy(picture):
        return np.argwhere(np.abs(picture[:, :, :3].astype(int) - (0, 114, 178)).max(2) < 30)

    one, two = drawn(0.8), drawn(0.8, 0.4)
    assert two.shape[0] > one.shape[0]
    places = of_policy(two)
    upper, lower = np.split(places, np.flatnonzero(np.diff(places[:, 0]) > 8)[:1] + 1)
    assert upper[:, 1].mean() > lower[:, 1].mean() + 100, "what saves more is drawn farther to the right"


def test_places_on_real_ground_need_a_folder(capsys):
    assert on_ground("a b") == tuple(
        ScenarioVariant(name, name, ("landscape.path='a b'",)) for name in ("landfire", "wildland")
    )
    for group, told in (("ground", "got ground, which needs ground"), ("tems", "got tems: did you mean teams?")):
        with pytest.raises(SystemExit, match="2"):
            command.main(["generalist", "--places", group])
        assert told in capsys.readouterr().err


def test_what_is_wrong_is_told_before_anything_is_played(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("warp_torchrl.benchmark.generalist.play_heuristics", lambda *given: pytest.fail("it played"))
    with pytest.raises(SystemExit, match="2"):
        command.main(["generalist", "--places", "giant", "ground", "--ground", str(tmp_path)])
    assert f"landscape.fuel must name one file in {tmp_path}" in capsys.readouterr().err


def test_a_policy_that_is_none_is_one_line(capsys):
    with pytest.raises(SystemExit, match="2"):
        command.main(["generalist", "--policy", "nowhere", "--places", "giant"])
    assert capsys.readouterr().err.startswith("error: ")
