"""The table of an evaluation where sight is limited, and where mechanics have metrics."""

import re

import numpy as np

from warp_torchrl.env.metrics import METRICS
from warp_torchrl.evaluation.report import EXTRA_METRICS, MEANING, WATCHING, evaluation_table, report
from warp_torchrl.world.mechanics.mechanic import Metric

WATCHED = Metric("watched", "more")


def episodes(watched, *further):
    return {
        **{name: np.zeros(4) for name in (*METRICS, *further)},
        **(
            {"watched": np.full(4, watched), "found": np.full(4, 0.5), "uncertainty": np.full(4, 0.25)}
            if further
            else {}
        ),
    }


def test_what_is_watched_has_a_table_of_its_own():
    content = report("front", "mine", 7, episodes(0.75, *WATCHING), {"noop": episodes(0.25, *WATCHING)}, goal=WATCHED)
    assert content["watching"]["noop"]["watched_difference"] == 0.5
    shown = evaluation_table(content).splitlines()
    assert "mine                        75.0    75.0 .. 75.0     50.0        0.250" in shown
    assert "mine - noop: +50.0 points watched, +50.0 .. +50.0; more on 100 % of fires" in shown
    assert not any("points saved" in line for line in shown), "none can act"
    acts = evaluation_table(report("search", "mine", 7, episodes(0.75, *WATCHING), {"noop": episodes(0.25, *WATCHING)}))
    assert "points saved" in acts and "points watched" in acts and "saved %" not in "".join(shown)
    lamed = {"scout_1": episodes(0.5, *WATCHING)}
    alone = report("front", "mine", 7, episodes(0.75, *WATCHING), {}, left_out=lamed, goal=WATCHED)
    assert "without scout_1          -25.0  -25.0 .. -25.0" in evaluation_table(alone).splitlines()


def told(further, *metrics):
    """The last table of worlds with further metrics."""
    none = {name: np.zeros(4) for name in further}
    content = report("mine", "mine", 7, episodes(0.0) | further, {"noop": episodes(0.0) | none})
    lines = evaluation_table(content, [*(row.metric for row in METRICS.values()), *metrics]).splitlines()
    return [line for line in lines if not line.startswith("averted")][-3:]


def test_a_metric_of_a_mechanic_has_a_table_to_itself():
    row = Metric("near_misses", "less", title="near misses")
    assert told({"near_misses": np.full(4, 0.125)}, row) == [
        "near misses %, less is better",
        "noop                                   0.0 (0.0 .. 0.0)",
        "mine                                12.5 (12.5 .. 12.5)",
    ]
    assert told({"depth": np.full(4, 0.125)}, Metric("depth", unit="1"))[1:] == [
        "noop                    0.000 (0.000 .. 0.000)",
        "mine                    0.125 (0.125 .. 0.125)",
    ]


def test_metrics_of_one_table_stand_side_by_side():
    shares = {"saved_north": np.full(4, 0.75), "saved_south": np.array([0.2, 0.2, 0.4, 0.4])}
    rows = [Metric(name, "more", title=name.removeprefix("saved_"), table="saved by land") for name in shares]
    title, noop, mine = told(shares, *rows)
    assert title == "saved by land %, more is better                     north                   south"
    assert noop.split() == ["noop", *("0.0 (0.0 .. 0.0)".split() * 2)]
    assert "75.0 (75.0 .. 75.0)" in mine and " 30.0 (2" in mine


def test_a_line_has_the_shares_saved_and_cleared_in_per_cent():
    values = {
        "saved": np.array([0.0, 0.5, 0.5, 0.6]),  # mean 0.4; the middle half's mean is 0.5
        "success": np.array([0.0, 0.0, 1.0, 0.0]),
        "control_time": np.full(4, 0.75),
        "cleared": np.full(4, 0.0125),
    }
    lines = evaluation_table(report("skirmish", "mine", 7, episodes(0.0) | values, {})).splitlines()
    (line,) = (line for line in lines if line.startswith("mine "))
    mean, _, _, _, iqm, success, control, cleared = line.split()[1:]
    assert (mean, iqm, success, control, cleared) == ("40.0", "50.0", "25.0", "0.75", "1.25")


def test_the_words_of_a_table_are_explained_under_it():
    lines = evaluation_table(report("skirmish", "mine", 7, episodes(0.0), {"noop": episodes(0.0)})).splitlines()
    titles = re.findall(r"[a-z]+", lines[1].replace("interval", ""))
    legend = "\n".join(lines[-4:])
    assert titles == ["policy", "saved", "iqm", "success", "control", "cleared"]
    assert all(f"{title}: " in legend for title in titles[1:]) and set(MEANING) == set(EXTRA_METRICS)
    assert "averted                  0.000    0.000 .. 0.000  trees saved beyond those of noop, a share of all" in lines
    seen = episodes(0.75, *WATCHING)
    watching = evaluation_table(report("front", "mine", 7, seen, {"noop": seen}, goal=WATCHED))
    assert all(f"{title}: " in watching for title in WATCHING) and "saved: " not in watching


def test_elsewhere_it_has_none():
    content = report("skirmish", "mine", 7, episodes(0.0), {"noop": episodes(0.0)})
    assert (
        content["watching"] == {}
        and "watched" not in evaluation_table(content)
        and "agency" not in evaluation_table(content)
    )


def test_a_goal_of_minutes_comes_first_and_fewer_are_better():
    minutes = Metric("contained_at", "less", "min")
    mine, other = (
        episodes(0.0) | {"contained_at": np.array(each)}
        for each in ([30.0, 30.0, 40.0, 40.0], [60.0, 60.0, 40.0, 40.0])
    )
    content = report("attack", "mine", 0, mine, {"noop": other}, left_out={"uav_0": other}, goal=minutes)
    assert content["by_goal"]["noop"]["probability_of_improvement"] == 0.75
    lines = evaluation_table(content, (minutes,)).splitlines()
    assert "contained_at min" in lines[1] and re.search(r"mine +35.0 +30.0 .. 40.0", lines[3]), lines
    assert re.fullmatch(r"mine - noop: -15.0 min contained_at, -\S+ .. \S+; less on 75 % of fires", lines[4]), lines[4]
    assert re.match(r"without uav_0 +\+15.0 ", lines[-1]), lines[-1]
    assert not any("contained_at" in line for line in lines[5:])
