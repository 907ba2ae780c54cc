"""Learning curves: what is read of run folders, which runs are one line, and what is drawn of them."""

import csv
import json
import math
import sys

import numpy as np
import pytest

from warp_torchrl.commands.curves import main
from warp_torchrl.evaluation.runs import curves
from warp_torchrl.evaluation.runs.curves import (
    MULTI,
    SINGLE,
    band,
    curve_figures,
    grouped_lines,
    learning_curves,
    lines_of,
)
from warp_torchrl.evaluation.runs.folders import bin_means, read_metrics, read_run, run_folders
from warp_torchrl.models import Entry, Signature
from warp_torchrl.runs import checkpoint as checkpoints
from warp_torchrl.runs.config.saved_config import SavedConfig

ACTIONS = tuple(f"action_{code}" for code in range(11))
SIGNATURE = Signature({"view": Entry((3, 5, 5), "uint8")}, Entry((9, 16, 16), "float32"), 2, ACTIONS, ("ugv", "uav"))
ALL = sorted({name for row in SINGLE + MULTI for name in row} | {"world/saved"})


def write_metrics(folder, frames=(1000, 2000, 3000), **columns):
    """Write a metrics.csv; a column's name has ``__`` for its slash, None is an empty cell."""
    folder.mkdir(parents=True, exist_ok=True)
    values = {"time/frames": list(frames), "time/seconds": [each / 10 for each in frames]}
    values |= {name.replace("__", "/"): list(column) for name, column in columns.items()}
    with (folder / "metrics.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([list(values), *zip(*values.values())])
    return folder


def write_run(folder, seed=0, n_agents=2, scenario="skirmish", steps=32, frames=(1000, 2000, 3000), columns=None, **to):
    """Write a run folder with a checkpoint; ``to`` sets algorithm, reward or observation."""
    write_metrics(folder, frames, **({"world__saved": np.linspace(0.2, 0.5, len(frames))} | (columns or {})))
    choices = {"algorithm": "mappo", "reward": "efficiency", "observation": "surroundings", "scenario": scenario} | to
    checkpoints.save(
        folder,
        frames=frames[-1],
        scenario=scenario,
        signature=SIGNATURE,
        mode="sampled",
        saved_config=SavedConfig(
            choices=choices, values={"seed": seed, "team": {"n_agents": n_agents}, "steps": steps}
        ),
        policy={},
        training={},
        keep=2,
    )
    return folder


def lines(*folders):
    return grouped_lines([read_run(folder) for folder in run_folders(folders)])


@pytest.fixture
def matplotlib():
    return pytest.importorskip("matplotlib", reason="figures are drawn with Matplotlib (extra figures)")


# Averaging


def test_two_seeds_on_different_grids_have_a_mean_and_a_band(tmp_path):
    # One rises by 1 each thousand from 0 at 1000; the other is 4 at 2000 and 0 at 4000. They share 2000 .. 3000:
    # 2000 and 3000 are the first's rows, 2000 the second's; there they are 1 and 4, then 2 and 2.
    # 2500 is a row of the second alone: 3 between its neighbours, where the first is 1.5.
    first = write_metrics(tmp_path / "a", (1000, 2000, 3000), train__loss=(0, 1, 2))
    second = write_metrics(tmp_path / "b", (2000, 2500, 4000), train__loss=(4, 3, 0))
    places, mean, low, high = band([read_run(first), read_run(second)], "time/frames", "train/loss")
    assert places.tolist() == [2000, 2500, 3000]
    assert mean.tolist() == [2.5, 2.25, 2.0]
    assert low.tolist() == [1.0, 1.5, 2.0] and high.tolist() == [4.0, 3.0, 2.0]


def test_missing_values_are_left_out_of_the_interpolation(tmp_path):
    run = read_run(
        write_metrics(tmp_path, (1, 2, 3, 4), train__loss=(None, 5, None, "nan"), world__saved=(1, "", 3, 4))
    )
    assert [each.tolist() for each in band([run], "time/frames", "train/loss")] == [[2], [5], [5], [5]]
    assert band([run], "time/frames", "world/saved")[0].tolist() == [1, 3, 4]
    assert band([run], "time/frames", "train/approx_kl") is None


def test_runs_that_share_no_stretch_have_no_band(tmp_path):
    early = read_run(write_metrics(tmp_path / "a", (1, 2), train__loss=(0, 1)))
    late = read_run(write_metrics(tmp_path / "b", (5, 6), train__loss=(0, 1)))
    assert band([early, late], "time/frames", "train/loss") is None


def test_means_over_bins_leave_out_what_is_missing():
    # (1 + 3) / 2, then 5 beside a missing value, a bin without any, and a last bin of one row.
    values = np.array([1, 3, 5, math.nan, math.nan, math.nan, 8])
    assert np.array_equal(bin_means(values, 2), [2, 5, math.nan, 8], equal_nan=True)
    assert bin_means(values, 1) is values


def test_only_files_of_many_rows_are_averaged(tmp_path):
    short = read_run(write_metrics(tmp_path / "a", range(1, 401)))
    long = read_run(write_metrics(tmp_path / "b", range(1, 402)))
    assert (short.rows_per_bin, len(short.columns["time/frames"])) == (1, 400)
    assert (long.rows_per_bin, len(long.columns["time/frames"])) == (2, 201)
    assert long.columns["time/frames"][[0, -1]].tolist() == [1.5, 401]


# Which runs are a line, and its name


def test_runs_that_differ_in_their_seed_alone_are_one_line(tmp_path):
    folders = [write_run(tmp_path / f"{seed}", seed=seed) for seed in (0, 1, 2)]
    other = write_run(tmp_path / "other", algorithm="dqn")
    three, one = lines(*folders, other)
    assert (three.label, len(three.runs)) == ("mappo (3 seeds)", 3)
    assert (one.label, len(one.runs)) == ("dqn", 1)


def test_runs_of_the_same_seed_are_not_called_seeds(tmp_path):
    (line,) = lines(write_run(tmp_path / "a"), write_run(tmp_path / "b"))
    assert line.label == "mappo (2 runs)"


@pytest.mark.parametrize(
    ("differs", "labels"),
    [
        ({"reward": "sparse"}, ["mappo efficiency", "mappo sparse"]),
        ({"observation": "map"}, ["mappo surroundings", "mappo map"]),
        ({"scenario": "village"}, ["mappo skirmish", "mappo village"]),
        ({"algorithm": "sac", "reward": "sparse"}, ["mappo efficiency", "sac sparse"]),
    ],
)
def test_a_label_names_what_differs(tmp_path, differs, labels):
    folders = [write_run(tmp_path / "a"), write_run(tmp_path / "b", **differs)]
    assert [line.label for line in lines(*folders)] == labels


def test_other_values_under_the_same_names_are_told_apart(tmp_path):
    first, second = lines(write_run(tmp_path / "a"), write_run(tmp_path / "b", seed=1, steps=64))
    assert first.label != second.label
    assert all(len(label) == len("mappo 012345") for label in (first.label, second.label))


def test_runs_may_be_called_something(tmp_path, matplotlib):
    for seed in (0, 1):
        write_run(tmp_path / "sweep" / str(seed), seed, steps=64)
    write_run(tmp_path / "a=b", steps=128)
    write_run(tmp_path / "one")
    given = [f"before={tmp_path / 'one'}", f"now={tmp_path / 'sweep'}", str(tmp_path / "a=b")]
    assert main([*given, "--out", str(tmp_path)]) == 0 and (tmp_path / "curves_saved.png").exists()
    drawn = [("before", tmp_path / "one"), ("now", tmp_path / "sweep"), tmp_path / "a=b"]
    legend = curve_figures(lines_of(drawn))["curves_saved"]().legends[0]
    assert [each.get_text() for each in legend.get_texts()] == ["before", "now (2 seeds)", "mappo"]


def test_a_learner_keeps_its_colour_and_a_scenario_its_width(tmp_path, matplotlib):
    runs = [("ppo", "single"), ("mappo", "single"), ("mappo", "skirmish"), ("dqn", "skirmish")]
    drawn = lines(*(write_run(tmp_path / f"{a}-{s}", algorithm=a, scenario=s) for a, s in runs))
    looks = {line.label: (line.look["color"], line.look["linestyle"], line.look["linewidth"]) for line in drawn}
    assert looks["mappo single"][:2] == looks["mappo skirmish"][:2]
    assert len({look[:2] for look in looks.values()}) == 3 and len(set(looks.values())) == 4
    assert looks["dqn skirmish"][2] == looks["mappo skirmish"][2] != looks["ppo single"][2]


def test_a_run_without_a_checkpoint_has_its_folder_s_name(tmp_path):
    early = write_metrics(tmp_path / "early_run")
    (early / "config.yaml").write_text("team: {n_agents: 1}\nscenario: single\n")
    recorded, named = lines(write_run(tmp_path / "a"), early)
    assert (recorded.label, named.label) == ("mappo", "early_run")
    assert (named.runs[0].n_agents, named.runs[0].scenario) == (1, "single")


def test_folders_of_one_name_are_told_apart(tmp_path):
    folders = [write_metrics(tmp_path / sweep / "0") for sweep in ("one", "two")]
    assert [line.label for line in lines(*folders)] == ["0 in one", "0 in two"]


def test_a_sweep_gives_all_its_runs_once_and_in_order(tmp_path):
    for job in (0, 2, 10):
        write_metrics(tmp_path / "sweep" / f"{job}")
    (tmp_path / "sweep" / "empty").mkdir()
    found = run_folders([tmp_path / "sweep", tmp_path / "sweep" / "2"])
    assert [folder.name for folder in found] == ["0", "2", "10"]


def test_each_path_is_listed_once_and_the_first_name_of_a_run_is_its_own(tmp_path, monkeypatch):
    for job in (0, 1):
        write_run(tmp_path / "sweep" / f"{job}", steps=32 + job)
    listed = []
    monkeypatch.setattr(curves, "run_folders", lambda paths: listed.extend(paths) or run_folders(paths))
    given = [("one", tmp_path / "sweep" / "1"), ("all", tmp_path / "sweep")]
    assert [line.label for line in lines_of(given)] == ["one", "all"]
    assert listed == [path for _, path in given]


# What is drawn


def test_which_figures_there_are_follows_the_runs(tmp_path):
    alone, team = write_run(tmp_path / "a", n_agents=1), write_run(tmp_path / "b", n_agents=3)
    unknown = write_metrics(tmp_path / "c")
    assert list(curve_figures(lines_of([alone]))) == ["curves_saved", "curves_single"]
    assert (
        list(curve_figures(lines_of([team])))
        == list(curve_figures(lines_of([unknown])))
        == ["curves_multi", "curves_saved"]
    )
    assert list(curve_figures(lines_of([alone, team]))) == ["curves_multi", "curves_saved", "curves_single"]


def test_the_paper_s_panels_are_drawn(tmp_path, matplotlib):
    both = [write_run(tmp_path / f"{seed}", seed, columns=dict.fromkeys(ALL, (1, 2, 4))) for seed in (0, 1)]
    for panels, count in ((SINGLE, 10), (MULTI, 9)):
        figure = learning_curves(lines(*both), panels, "title")
        assert len(figure.axes) == len({axes.get_ylabel() for axes in figure.axes}) == count
        assert all(len(axes.lines) == len(axes.collections) == 1 for axes in figure.axes)
        (text,) = figure.legends[0].get_texts()
        assert text.get_text() == "mappo (2 seeds)"
        assert "title, scenario skirmish\n" in figure.get_suptitle() and "minimum to maximum" in figure.get_suptitle()


def test_a_panel_without_values_says_so(tmp_path, matplotlib):
    figure = learning_curves(lines(write_metrics(tmp_path / "$x", train__loss=(3, 2, 1))), MULTI, "title")
    said = {axes.get_ylabel(): [text.get_text() for text in axes.texts] for axes in figure.axes}
    assert said.pop("loss") == []
    assert len(said) == 8 and all(texts == ["no values"] for texts in said.values())


def test_forest_saved_has_a_row_for_each_scenario_and_its_own_minutes(tmp_path, matplotlib):
    first, second = write_run(tmp_path / "a"), write_run(tmp_path / "b", scenario="village", frames=(600, 1200))
    figure = curve_figures(lines_of([first, second]))["curves_saved"]()
    titles = [axes.get_title() for axes in figure.axes]
    assert titles == ["scenario skirmish"] * 2 + ["scenario village"] * 2
    steps, minutes = (axes.lines[0].get_xydata() for axes in figure.axes[2:])
    assert np.allclose(steps, [[600, 20], [1200, 50]])
    assert np.allclose(minutes, [[1, 20], [2, 50]])


@pytest.mark.parametrize(
    ("last", "drawn", "label"),
    [
        (1_999, 1_999, "world steps"),
        (2_000, 2, "world steps [thousand]"),
        (999_999, 999.999, "world steps [thousand]"),
        (1_000_000, 1, "world steps [million]"),
    ],
)
def test_steps_are_counted_in_units_that_are_read_easily(tmp_path, last, drawn, label):
    factor, told = curves._steps(lines(write_metrics(tmp_path, (10, last))))
    assert (factor * last, told) == (pytest.approx(drawn), label)


def test_means_over_bins_are_said(tmp_path, matplotlib):
    frames = range(10, 9010, 10)
    run = write_run(tmp_path, frames=frames, columns={"train__loss": frames})
    assert (
        "more than 400 rows as means over bins, of up to 3 rows"
        in curve_figures(lines_of([run]))["curves_multi"]().get_suptitle()
    )


# The command


@pytest.mark.slow
def test_it_draws_the_same_bytes_twice(tmp_path, capsys, matplotlib):
    runs = [write_run(tmp_path / f"run{seed}", seed, columns={"train__loss": (seed, 1, 2)}) for seed in (0, 1)]
    written = []
    for out in (tmp_path / "one", tmp_path / "two"):
        assert main([*map(str, runs), "--out", str(out)]) == 0
        written.append({path.name: path.read_bytes() for path in out.iterdir()})
    assert written[0] == written[1] and set(written[0]) == {"curves_multi.png", "curves_saved.png"}
    assert [line.split()[0] for line in capsys.readouterr().out.splitlines()] == ["curves_multi", "curves_saved"] * 2


def test_it_writes_into_the_current_folder_by_default(tmp_path, monkeypatch, matplotlib):
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    assert main([str(write_run(tmp_path / "run", n_agents=1))]) == 0
    assert sorted(path.name for path in (tmp_path / "here").iterdir()) == ["curves_saved.png", "curves_single.png"]


def the_one_line(capsys, *arguments):
    assert main([*map(str, arguments)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_it_needs_a_run(capsys, matplotlib):
    assert "at least one run" in the_one_line(capsys)


def test_a_folder_must_be_there_and_hold_runs(tmp_path, capsys, matplotlib):
    assert "got nowhere" in the_one_line(capsys, "nowhere")
    assert "no metrics.csv" in the_one_line(capsys, tmp_path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "no column time/frames"),
        ("time/seconds,train/loss\n1,2\n", "no column time/frames"),
        ("time/frames,train/loss\n", "no rows"),
        ("time/frames,train/loss\n1,2\n2,high\n", "line 3, train/loss: 'high' is not a number"),
        ("time/frames,train/loss\n1,2\n2\n", "line 3 has 1 cells, the header has 2"),
        ("time/frames,train/loss\n1,2\n2,3,4\n", "line 3 has 3 cells"),
        ("time/frames,train/loss\n1,2\n,3\n", "time/frames must be in every row"),
        ("time/frames,train/loss\n2,2\n1,3\n", "time/frames must be in every row, positive, and grow"),
        ("time/frames,time/seconds\n1,2\n2,1\n", "time/seconds must"),
        ("time/frames,train/loss\n1," + "2" * 200_000 + "\n", "field larger"),
        (b"time/frames\n\xff\n", "utf-8"),
    ],
)
def test_a_malformed_file_is_told_in_one_line(content, said, tmp_path, capsys, matplotlib):
    (tmp_path / "metrics.csv").write_bytes(content if isinstance(content, bytes) else content.encode())
    line = the_one_line(capsys, tmp_path, "--out", tmp_path)
    assert said in line and str(tmp_path / "metrics.csv") in line
    assert not list(tmp_path.glob("*.png"))


def test_a_file_that_is_too_large_is_refused_unread(tmp_path, monkeypatch):
    monkeypatch.setattr("warp_torchrl.evaluation.runs.folders._LARGEST", 10)
    write_metrics(tmp_path)
    with pytest.raises(ValueError, match="is too large: 62 bytes"):
        read_metrics(tmp_path / "metrics.csv")


@pytest.mark.parametrize("content", ["a: [1", "a: !!python/object/apply:os.getcwd []", "[" * 900])
def test_a_config_that_is_not_one_is_told_in_one_line(content, tmp_path, capsys, matplotlib):
    (write_metrics(tmp_path) / "config.yaml").write_text(content)
    assert "config.yaml is not a run's configuration" in the_one_line(capsys, tmp_path)


def test_a_checkpoint_without_a_configuration_is_told_in_one_line(tmp_path, capsys, matplotlib, monkeypatch):
    monkeypatch.setattr(checkpoints.Checkpoint, "saved_config", lambda self: SavedConfig(choices={}, values={}))
    assert "config.json does not hold" in the_one_line(capsys, write_run(tmp_path))


def test_without_matplotlib_it_says_what_to_install(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert 'pip install "warp_torchrl[figures]"' in the_one_line(capsys, write_metrics(tmp_path))


def test_a_run_is_drawn_by_the_goal_that_its_evaluation_says(tmp_path, matplotlib):
    folder = write_run(tmp_path, columns={"world__escaped": [0.9, 0.8, 0.4]})
    (each,) = lines(folder)
    assert each.runs[0].goal.name == "saved"
    told = {"scenario": "skirmish", "method": "mappo", "configuration": "c", "seeds": [1], "goal": "escaped"}
    told |= {"goal_better": "less", "goal_unit": "%", "episodes": [{"escaped": 0.0, "success": 1.0}]}
    (folder / "evaluation.json").write_text(json.dumps(told))
    panel = curves.saved_curves(lines(folder)).axes[0]
    assert panel.get_ylabel() == "escaped [%]" and panel.get_lines()[0].get_ydata().tolist() == [90.0, 80.0, 40.0]
