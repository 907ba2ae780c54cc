"""When runs first save a share of the forest, by hand."""

import pytest

from tests.evaluation.runs.test_curves import write_run
from warp_torchrl.commands.curves import main
from warp_torchrl.evaluation.runs.folders import read_run
from warp_torchrl.evaluation.runs.reached import first_reached

FRAMES = range(100, 4100, 100)  # a window of a twentieth: 100 to each side, three batches
SAVED = [0.9, *[0.1] * 19, *[0.4] * 10, *[0.7] * 10]


@pytest.fixture
def run(tmp_path):
    return write_run(tmp_path / "run", frames=FRAMES, columns={"world__saved": SAVED})


@pytest.mark.parametrize(
    ("level", "frames"),
    [
        (0.2, 2000),  # (0.1 + 0.1 + 0.4) / 3
        (0.25, 2100),  # (0.1 + 0.4 + 0.4) / 3 = 0.3
        (0.4, 2200),
        (0.7, 3200),
        (0.71, None),
    ],
)
def test_a_level_is_reached_by_the_mean_of_the_batches_about_one(run, level, frames):
    found = first_reached(read_run(run), level - 1e-9)
    assert found == (None if frames is None else (frames, frames / 10))


def test_short_episodes_of_the_first_batches_do_not_count(tmp_path):
    for first, frames in (([0.9, 0.1], None), ([0.1, 0.9], 200)):
        run = write_run(tmp_path / f"{frames}", frames=FRAMES, columns={"world__saved": first + [None] * 38})
        assert first_reached(read_run(run), 0.8) == (frames and (frames, frames / 10))


def test_it_is_printed_for_each_line(run, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    other = write_run(tmp_path / "other", seed=1, frames=FRAMES, columns={"world__saved": [*SAVED[1:], 0.7]})
    given = [f"now={run}", f"now={other}", "--out", str(tmp_path), "--reach", "40,70.5"]
    assert main([*given]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "| now (2 seeds) | 2 k, 210 .. 220 s | never |"
    with pytest.raises(SystemExit):
        main([str(run), "--reach", "101"])
    assert "must be percentages in 0..100, got 101" in capsys.readouterr().err
