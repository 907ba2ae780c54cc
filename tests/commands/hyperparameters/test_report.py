"""The table, the CSV, the best values and the figure of a search."""

import csv

import pytest

optuna = pytest.importorskip("optuna", reason="needs the extra search")

from optuna.trial import TrialState, create_trial

from warp_torchrl.commands.hyperparameters.figure import SEARCH_FIGURE, draw_search
from warp_torchrl.commands.hyperparameters.report import BEST, CSV, TABLE, experiment, trials_table, write
from warp_torchrl.runs.config.compose import compose_config
from warp_torchrl.runs.config.options import SearchOptions
from warp_torchrl.runs.config.plain_values import plain
from warp_torchrl.runs.config.space import dimension
from warp_torchrl.world.mechanics.mechanic import Metric

GAMMA, EPOCHS, ACTIVATION = "algorithm.gamma", "algorithm.epochs", "model.activation"
SPACE = [dimension(f"{GAMMA}=interval(0, 1)"), dimension(f"{EPOCHS}=range(1, 9)"), dimension(f"{ACTIVATION}=relu,tanh")]
DISTRIBUTIONS = {
    GAMMA: optuna.distributions.FloatDistribution(0.0, 1.0),
    EPOCHS: optuna.distributions.IntDistribution(1, 8),
    ACTIVATION: optuna.distributions.CategoricalDistribution(("relu", "tanh")),
}


def add(study, gamma, saved=None, state="COMPLETE", path=(), **attributes):
    study.add_trial(
        create_trial(
            state=TrialState[state],
            value=saved,
            params={GAMMA: gamma, EPOCHS: 3, ACTIVATION: "relu" if gamma > 0.5 else "tanh"},
            distributions=DISTRIBUTIONS,
            intermediate_values=dict(path),
            user_attrs=attributes,
        )
    )


@pytest.fixture
def study():
    made = optuna.create_study(direction="maximize")
    add(made, 0.25, 0.5, values=[0.5], **{"as it is": True})
    add(made, 0.1, 0.2, "PRUNED", {25: 0.1, 30: 0.2})
    add(made, 0.75, 0.625, values=[0.625], path={25: 0.3, 100: 0.6})
    add(made, 0.3, None, "FAIL", reason="it fell over")
    add(made, 0.2, 0.1, "PRUNED", {25: 0.05, 60: 0.1})
    add(made, 0.9, None, "PRUNED", reason="not finite")
    return made


def test_the_table_has_the_best_first_and_those_that_came_furthest_next(study):
    assert trials_table(study, SPACE).splitlines()[2:] == [
        "| 2 | trained | 62.5 | - | 0.75 | 3 | relu |",
        "| 0, as it is | trained | 50.0 | - | 0.25 | 3 | tanh |",
        "| 4 | pruned at 60 % | 10.0 | - | 0.2 | 3 | tanh |",
        "| 1 | pruned at 30 % | 20.0 | - | 0.1 | 3 | tanh |",
        "| 5 | pruned at 0 % | - | - | 0.9 | 3 | relu |",
        "| 3 | failed | - | - | 0.3 | 3 | tanh |",
    ]


def test_of_a_goal_of_which_less_is_better_the_least_is_the_best(tmp_path):
    study, goal = optuna.create_study(direction="minimize"), Metric("fire_size", "less", "ha", title="fire size")
    for gamma, size in ((0.25, 31.0), (0.75, 12.5), (0.1, 40.0)):
        add(study, gamma, size, values=[size])
    page = write(study, SPACE, [], SearchOptions(), tmp_path, goal)
    assert "| trial | state | fire size ha |" in page and page.index("| 12.5 |") < page.index("| 31.0 |")
    assert "The best is trial 1: 12.5 ha fire size in its evaluation." in page
    assert "trial,state,fire_size,lowest" in (tmp_path / CSV).read_text()


def test_what_ten_trials_hang_on_is_told(study):
    assert "importance" not in trials_table(study, SPACE)
    for place in range(12):
        add(study, 0.08 * place, 0.08 * place, values=[0.08 * place])
    row = trials_table(study, SPACE).splitlines()[-1]
    name, *_, gamma, epochs, activation = (cell.strip(" %") for cell in row.strip("|").split("|"))
    assert name == "importance" and float(gamma) > 50.0 > float(epochs), row  # saved is gamma, epochs always 3
    assert float(gamma) + float(epochs) + float(activation) == pytest.approx(100.0, abs=1.0)


def test_the_files_say_the_same(study, tmp_path):
    page = write(study, SPACE, ["scenario=single"], SearchOptions(), tmp_path)
    assert (tmp_path / TABLE).read_text() == page + "\n"
    assert "The best is trial 2: 62.5 % saved in its evaluation. Each trial is one seed" in page
    assert "python train.py scenario=single algorithm.gamma=0.75 algorithm.epochs=3 model.activation=relu\n" in page
    with (tmp_path / CSV).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["trial"] for row in rows] == ["2", "0", "4", "1", "5", "3"]
    assert rows[0]["saved"] == "0.625" and rows[0][GAMMA] == "0.75" and rows[2]["percent"] == "60"
    assert rows[-1]["reason"] == "it fell over" and rows[-1]["saved"] == ""


def test_the_seeds_of_trials_say_how_much_is_noise(tmp_path):
    study = optuna.create_study(direction="maximize")
    add(study, 0.5, 0.5, values=[0.4, 0.6])  # variances 0.02 and 0.08, together 0.05, deviation 0.2236
    add(study, 0.6, 0.6, values=[0.4, 0.8])
    page = write(study, SPACE, [], SearchOptions(seeds=2), tmp_path)
    assert "| 1 | trained | 60.0 | 40.0 .. 80.0 | 0.6 | 3 | relu |" in page
    assert "differ by 22.4 % (standard deviation), means of 2 by 15.8 %" in page


def test_a_search_without_a_trained_trial_has_a_table_and_no_best(tmp_path):
    study = optuna.create_study(direction="maximize")
    add(study, 0.5, 0.2, "PRUNED", {25: 0.2})
    assert write(study, SPACE, [], SearchOptions(), tmp_path).endswith("No trial was trained to its end.")
    assert not (tmp_path / BEST).exists()
    draw_search(study, SPACE, tmp_path)
    assert not (tmp_path / SEARCH_FIGURE).exists()


@pytest.mark.parametrize(
    "overrides",
    [
        ["algorithm=a2c", "scenario=single", "algorithm.learning_rate=3e-05", "n_worlds=64"],
        ["experiment=skirmish", "model.actor_hidden=[64,32]", "imitation.teacher=null", "model.activation=relu"],
        ["total_frames=1_000", "experiment=quick", "model=cnn", "algorithm.value_norm=False"],
    ],
)
def test_the_best_values_are_an_experiment(overrides, tmp_path):
    (tmp_path / "experiment").mkdir()
    (tmp_path / BEST).write_text(experiment(overrides, "Trial 3."))
    found = compose_config("train", [f"hydra.searchpath=[file://{tmp_path}]", "experiment=best"])
    assert plain(found) == plain(compose_config("train", overrides))


@pytest.mark.slow
def test_the_figure_has_a_panel_for_each_key(study, tmp_path):
    pytest.importorskip("matplotlib", reason="needs the extra figures")
    import numpy as np
    from PIL import Image

    rate = optuna.distributions.FloatDistribution(0.1, 1.0, log=True)
    made = optuna.create_study(direction="maximize")
    for trial in (each for each in study.trials if each.state.name != "FAIL"):
        parts = {name: getattr(trial, name) for name in ("state", "value", "intermediate_values", "user_attrs")}
        both = {"params": {**trial.params, "rate": 0.3}, "distributions": {**DISTRIBUTIONS, "rate": rate}}
        made.add_trial(create_trial(**parts, **both))
    draw_search(made, SPACE, tmp_path)
    small = Image.open(tmp_path / SEARCH_FIGURE).size
    draw_search(made, [*SPACE, dimension("rate=tag(log, interval(0.1, 1))")], tmp_path)
    picture = Image.open(tmp_path / SEARCH_FIGURE).convert("RGB")
    assert picture.size[0] == small[0] and picture.size[1] > small[1], "four keys have two rows"
    pixels = np.asarray(picture).reshape(-1, 3)
    best, trained = (np.abs(pixels - np.array(colour)).max(1) < 3 for colour in ((213, 94, 0), (0, 114, 178)))
    assert best.sum() > 500 and trained.sum() > 200
