"""What a sweep came to: runs that are gathered, the table, the figure."""

import json
import signal
import subprocess
import sys

import numpy as np
import pytest

from warp_torchrl.evaluation.rows import read_rows
from warp_torchrl.evaluation.summary import draw_summary, main, summary_table


def write(folder, policy, saved, scenario="tiny", configuration="", seeds=None):
    folder.mkdir(parents=True)
    seeds = list(range(len(saved))) if seeds is None else seeds
    episodes = [{"seed": seed, "saved": value, "success": float(value >= 0.6)} for seed, value in zip(seeds, saved)]
    content = {"scenario": scenario, "method": policy, "configuration": configuration, "seeds": seeds}
    (folder / "evaluation.json").write_text(json.dumps(content | {"episodes": episodes}))


@pytest.fixture
def sweep(tmp_path):
    write(tmp_path / "0", "mappo", [0.5, 0.7, 0.9], configuration="aaaaaaaa")
    write(tmp_path / "1", "mappo", [0.7, 0.9, 0.5], configuration="aaaaaaaa")
    write(tmp_path / "2", "local", [0.5, 0.5, 0.6])
    write(tmp_path / "3", "local", [0.1, 0.2, 0.3], scenario="other")
    return tmp_path


def test_runs_that_were_trained_alike_are_gathered(sweep):
    mappo, local, other = read_rows(sweep)
    assert mappo.policy == "mappo" and mappo.value.shape == (2, 3)
    assert local.value.tolist() == [[0.5, 0.5, 0.6]] and local.success.tolist() == [[0.0, 0.0, 1.0]]
    assert other.scenario == "other"


def test_baselines_are_those_of_any_evaluation_that_holds_them(sweep):
    path = sweep / "0" / "evaluation.json"
    held = {"saved": [0.2, 0.3, 0.4], "success": [0.0, 0.0, 1.0]}
    content = json.loads(path.read_text()) | {"baseline_episodes": {"noop": held, "local": held}}
    path.write_text(json.dumps(content))
    entries = {(entry.scenario, entry.policy): entry for entry in read_rows(sweep)}
    assert entries["tiny", "noop"].value.tolist() == [[0.2, 0.3, 0.4]]
    assert entries["tiny", "noop"].success.tolist() == [[0.0, 0.0, 1.0]] and ("other", "noop") not in entries
    assert entries["tiny", "local"].value.tolist() == [[0.5, 0.5, 0.6]], "its own evaluation comes first"


def test_baselines_that_met_other_worlds_are_left_out(sweep):
    for run, saved in (("0", 0.2), ("1", 0.4)):
        path = sweep / run / "evaluation.json"
        held = {
            "noop": {"saved": [saved] * 3, "success": [0.0] * 3},
            "random": {"saved": [0.1] * 3, "success": [0.0] * 3},
        }
        path.write_text(json.dumps(json.loads(path.read_text()) | {"baseline_episodes": held}))
    assert [entry.policy for entry in read_rows(sweep)] == ["random", "mappo", "local", "local"]


def test_worlds_that_differ_from_their_scenario_s_are_a_place_of_their_own(sweep):
    path = sweep / "2" / "evaluation.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"world_overrides": ["team.n_agents=4", "horizon=9"]}))
    assert [entry.scenario for entry in read_rows(sweep)] == ["tiny", "tiny team.n_agents=4 horizon=9", "other"]


def test_runs_that_were_trained_differently_are_told_apart(sweep):
    write(sweep / "4", "mappo", [0.1, 0.1, 0.1], configuration="bbbbbbbb")
    assert [entry.policy for entry in read_rows(sweep)] == ["mappo aaaaaa", "local", "local", "mappo bbbbbb"]


def test_the_table_puts_the_best_first_and_compares_with_it(sweep):
    header, _, first, second, third = summary_table(read_rows(sweep)).splitlines()
    assert "saved %" in header
    assert first.split("|")[1:5] == [" tiny ", " mappo ", " 2 ", " 3 "] and "| 70.0 |" in first
    # Local against the two runs, paired by world: 0.5333 - 0.7; better only where 0.6 beats 0.5, one of six; and
    # equal where 0.5 meets 0.5, half of one: 1.5 / 6.
    assert second.split("|")[2] == " local " and "| -16.7 |" in second and second.endswith("| 25 % |")
    assert third.startswith("| other | local") and third.endswith("| - | - | - |")


def test_policies_on_other_fires_are_not_compared(sweep):
    write(sweep / "4", "greedy", [0.1, 0.1, 0.1], seeds=[7, 8, 9])
    row = next(line for line in summary_table(read_rows(sweep)).splitlines() if "greedy" in line)
    assert row.endswith("| - | - | - |")


def test_any_runs_are_compared_with_any_of_them(sweep, capsys):
    main([str(sweep / "0"), str(sweep / "1"), str(sweep / "2"), "--against", "local"])
    header, _, first, second = capsys.readouterr().out.splitlines()
    assert "to local" in header
    assert "| +16.7 |" in first and first.endswith("| 75 % |") and second.endswith("| - | - | - |")


def test_a_policy_that_no_run_has_is_told(sweep, capsys):
    with pytest.raises(SystemExit):
        main([str(sweep), "--against", "locl"])
    assert "against must be one of mappo, local, got locl: did you mean local?" in capsys.readouterr().err


def test_other_metrics_are_shown_where_they_were_evaluated(sweep, capsys):
    for run, numbers in (("0", [1.0, None, 2.0]), ("1", [0.0, 3.0, None]), ("2", [None, None, None])):
        path = sweep / run / "evaluation.json"
        content = json.loads(path.read_text())
        for episode, number in zip(content["episodes"], numbers, strict=True):
            episode["division"] = number
        path.write_text(
            json.dumps(content | {"baseline_episodes": {"noop": {"saved": [0.1] * 3, "success": [0.0] * 3}}})
        )
    main([str(sweep), "--show", "division", "saved"])
    header, _, *rows = capsys.readouterr().out.splitlines()
    assert header == "| scenario | policy | runs | fires | division | saved |"
    assert rows == [
        "| tiny | mappo | 2 | 3 | 1.500 | 0.700 |",  # (1 + 2 + 0 + 3) / 4
        "| tiny | local | 1 | 3 | - | 0.533 |",
        "| other | local | 1 | 3 | - | 0.200 |",
    ]
    with pytest.raises(SystemExit):
        main([str(sweep), "--show", "divisoin"])
    assert "divisoin is not evaluated; saved, success, division are" in capsys.readouterr().err


def test_teams_that_watch_are_compared_by_what_they_watch_in_a_table_of_their_own(sweep, capsys):
    write(sweep / "5", "dqn", [0.3, 0.3, 0.3], scenario="front")
    path = sweep / "5" / "evaluation.json"
    content = json.loads(path.read_text())
    for episode, watched in zip(content["episodes"], (0.6, 0.7, 0.8), strict=True):
        episode["watched"] = watched
    held = {"follower": {"saved": [0.3] * 3, "success": [0.0] * 3, "watched": [0.5, 0.5, 0.8]}}
    path.write_text(json.dumps(content | {"goal": "watched", "baseline_episodes": held}))
    main([str(sweep), "--against", "follower"])
    of_trees, of_fronts = capsys.readouterr().out.split("\n\n")
    assert "saved %" in of_trees and "front" not in of_trees
    header, _, first, second = of_fronts.splitlines()
    assert "watched %" in header and first.split("|")[1:6] == [" front ", " dqn ", " 1 ", " 3 ", " 70.0 "]
    assert "| +10.0 |" in first and first.endswith("| 83 % |"), "better on two of three, and equal on one"
    assert second.split("|")[2] == " follower " and "| 60.0 |" in second


def test_a_goal_of_which_less_is_better_is_shown_in_its_unit_and_the_least_comes_first(sweep, tmp_path, capsys):
    for run, policy, minutes in (("5", "slow", (60.0, 90.0, 120.0)), ("6", "quick", (30.0, 90.0, 60.0))):
        write(sweep / run, policy, [0.3, 0.3, 0.3], scenario="attack")
        path = sweep / run / "evaluation.json"
        content = json.loads(path.read_text())
        for episode, value in zip(content["episodes"], minutes, strict=True):
            episode["contained_at"] = value
        path.write_text(json.dumps(content | {"goal": "contained_at", "goal_better": "less", "goal_unit": "min"}))
    main([str(sweep)])
    header, _, first, second = capsys.readouterr().out.split("\n\n")[1].splitlines()
    assert "| contained_at min |" in header and first.split("|")[2] == " quick " and "| 60.0 |" in first
    quick, slow = (row for row in read_rows(sweep) if row.scenario == "attack")
    assert "| +30.0 |" in second and second.endswith("| 17 % |"), "equal on one of three"
    draw_summary([quick, slow], tmp_path / "summary.png")


def test_folders_without_evaluations_are_refused(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main([str(tmp_path)])
    assert "no evaluation.json under" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["missing", "file"])
def test_a_folder_that_is_none_is_refused_beside_one_that_is(sweep, capsys, name):
    (sweep / "file").touch()
    with pytest.raises(SystemExit) as end:
        main([str(sweep), str(sweep / name)])
    assert end.value.code == 2
    assert capsys.readouterr() == ("", f"error: FOLDER must be a folder that is there, got {sweep / name}\n")


def test_a_missing_matplotlib_is_told_after_the_table(sweep, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(SystemExit):
        main([str(sweep), "--plot", str(sweep / "figure.png")])
    printed = capsys.readouterr()
    assert "| mappo |" in printed.out and "plot needs Matplotlib: pip install" in printed.err


def test_the_figure_shows_means_and_the_share_of_fires_that_reach_each_level(sweep, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure
    from matplotlib.image import imread

    save, kept = Figure.savefig, []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *to, **how: (kept.append(figure), save(figure, *to, **how)))
    entries = read_rows(sweep)
    draw_summary(entries, tmp_path / "summary.png")
    assert np.ptp(imread(tmp_path / "summary.png")[..., :3]) > 0.5
    tiny = [entry for entry in entries if entry.scenario == "tiny"]
    bars, profile, *_ = kept[0].axes
    widths = [bar.get_width() for bar in reversed(bars.patches)]  # the best above
    assert widths == pytest.approx(sorted((100 * entry.value.mean() for entry in tiny), reverse=True))
    for line in profile.get_lines():
        values = next(100.0 * entry.value for entry in tiny if entry.policy == line.get_label()).reshape(-1, 1)
        x, y = line.get_data()
        assert (x[0], x[-1]) == (0.0, 100.0)
        apart = (np.abs(values - x) > 1e-6).all(0)
        assert y[apart] == pytest.approx(100.0 * (values >= x).mean(0)[apart])


def test_help_explains_the_columns_of_the_table(sweep, capsys):
    with pytest.raises(SystemExit):
        main(["--help"])
    told = " ".join(capsys.readouterr().out.split())
    columns = [each.strip(" |%") for each in summary_table(read_rows(sweep)).splitlines()[0].split(" | ")]
    assert {"iqm", "success", "better on"} <= {each for each in columns if f"{each}:" in told}
    assert "95 %: bootstrap" in told and "averted: trees saved beyond those of noop" in told


@pytest.mark.skipif(not hasattr(signal, "SIGPIPE"), reason="no pipes that are closed under a writer")
@pytest.mark.slow
def test_a_reader_that_has_seen_enough_gets_no_traceback(sweep):
    command = [sys.executable, "-u", "-m", "warp_torchrl.evaluation.summary", str(sweep)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as run:
        run.stdout.close()  # long before the table is there
        assert run.stderr.read() == ""
    assert run.returncode == -signal.SIGPIPE
