"""Evaluations of others: what is sound is read, all else refused in one line."""

import json
import re

import pytest

from warp_torchrl.evaluation.reading import read_evaluation
from warp_torchrl.evaluation.rows import read_rows
from warp_torchrl.evaluation.summary import draw_summary, main, summary_table
from warp_torchrl.runs.config.construction import ConfigError

SOUND = {
    "scenario": "tiny",
    "method": "mappo",
    "configuration": "aaaa",
    "seeds": [5, 6],
    "episodes": [
        {"seed": 5, "saved": 0.5, "success": 0.0},
        {
            "seed": 6,
            "saved": 1.0,
            "success": 1.0,
        },
    ],
    "baseline_episodes": {"noop": {"saved": [0.1, 0.2], "success": [0.0, 0.0]}},
}


def written(folder, **changes):
    path = folder / "evaluation.json"
    path.write_text(json.dumps(SOUND | changes))
    return path


def test_a_sound_one_is_read_with_what_earlier_ones_left_out(tmp_path):
    saved = {"goal": "saved", "goal_better": "more", "goal_unit": "%"}
    assert read_evaluation(written(tmp_path)) == {**saved, "world_overrides": [], **SOUND}


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"scenario": None}, "scenario must be a text, got None"),
        ({"method": ["a"]}, "method must be a text"),
        ({"configuration": 7}, "configuration must be a text"),
        ({"world_overrides": [1]}, "world_overrides must be texts"),
        ({"goal": "[gold](x)"}, "goal must name a metric, got '[gold](x)'"),
        ({"goal_better": ""}, "goal_better must be one of more, less, got ''"),
        ({"goal_unit": "acre"}, "goal_unit must be one of %, 1, min, ha, USD, got 'acre'"),
        ({"goal": "watched"}, "episodes must have watched"),
        ({"seeds": []}, "seeds must be 1 to 100000 whole numbers"),
        ({"seeds": [1, "2"]}, "seeds must be 1 to"),
        ({"seeds": [1, True]}, "seeds must be 1 to"),
        ({"episodes": {}}, "episodes must be one for each of 2 seeds"),
        ({"episodes": SOUND["episodes"][:1]}, "episodes must be one for each of 2 seeds"),
        ({"episodes": [SOUND["episodes"][0], {"seed": 6}]}, "episodes must have the same metrics"),
        ({"episodes": [{"saved": 1.0}] * 2}, "episodes must have success"),
        ({"episodes": [{"saved": None, "success": 1.0}] * 2}, "saved must hold finite numbers, got None"),
        ({"episodes": [{"saved": 10**400, "success": 1.0}] * 2}, "saved must hold finite numbers, got 1000"),
        ({"episodes": [{"saved": "all", "success": 1.0}] * 2}, "saved must hold finite numbers, got 'all'"),
        ({"baseline_episodes": []}, "baseline_episodes must be a mapping"),
        ({"baseline_episodes": {"noop": 1}}, "the episodes of noop must be a mapping"),
        ({"baseline_episodes": {"noop": {}}}, "episodes must have saved"),
        (
            {"baseline_episodes": {"noop": {"saved": [1, 2], "success": [1]}}},
            "success of noop must be one for each of 2",
        ),
        ({"more": float("nan")}, "NaN is no number"),
    ],
    ids=str,
)
def test_what_is_no_evaluation_is_refused_in_one_line(tmp_path, changes, told):
    path = written(tmp_path, **changes)
    with pytest.raises(ConfigError, match=f"^{path}.*{re.escape(told)}") as raised:
        read_evaluation(path)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("content", ["", "[]", "{}", "[" * 100_000, '{"seeds": [1], "seeds": [2]}', "\0", "\xff"])
def test_a_summary_of_something_else_ends_with_one_line(tmp_path, capsys, content):
    (tmp_path / "evaluation.json").write_bytes(content.encode("latin-1"))
    with pytest.raises(SystemExit) as end:
        main([str(tmp_path)])
    assert end.value.code == 2 and "Traceback" not in (errors := capsys.readouterr().err)
    assert str(tmp_path / "evaluation.json") in errors.splitlines()[-1]


def test_names_of_others_make_no_cell_and_no_formula(tmp_path):
    pytest.importorskip("matplotlib")
    written(tmp_path, method="\x1b[31ma | b $\\frac{", scenario="| x\n| y |", baseline_episodes={})
    entries = read_rows(tmp_path)
    *_, row = summary_table(entries).splitlines()
    assert row.startswith("| \\| x \\| y \\| | a \\| b $\\frac{ | 1 | 2 |") and "\x1b" not in row
    draw_summary(entries, tmp_path / "a.png")
