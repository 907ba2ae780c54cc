"""Training by several processes is timed beside one process."""

from warp_torchrl.benchmark import processes
from warp_torchrl.benchmark.processes import process_scaling, process_table

SMALL = ["horizon=8", "landscape.size=12", "collector.steps=4", "model.actor_hidden=[8]", "model.critic_hidden=[8]"]


def test_speed_beside_as_many_times_that_of_one_process_at_fixed_worlds_in_all_and_of_each(monkeypatch):
    # Two processes take 1 s for the worlds that one takes 1 s for, and 1.25 s for twice as many, of 0.5 s work each.
    def batches(values):
        worlds, count = values["n_worlds"], values["processes"]
        wall = {(1, 4): 1.0, (2, 4): 1.0, (2, 8): 1.25}[count, worlds]
        return [processes._Batch(worlds * 4, wall, 0.5)] * 3

    monkeypatch.setattr(processes, "_batches", batches)
    rows = process_scaling(["scenario=skirmish", *SMALL], worlds=4, most=3, turns=2)
    assert [(row["scaling"], row["processes"], row["worlds"]) for row in rows] == [
        ("", 1, 4),
        ("strong", 2, 4),
        ("weak", 2, 8),
    ]
    assert [row["frames_per_second"] for row in rows] == [16.0, 16.0, 25.6]
    assert [row["efficiency"] for row in rows] == [1.0, 0.5, 0.8]
    assert [row["work"] for row in rows] == [1.0, 2.0, 1.0]
    assert "strong" in process_table(rows)


def test_a_batch_of_one_process_has_frames_and_times():
    (row,) = process_scaling(["scenario=skirmish", *SMALL], worlds=2, most=1, turns=1)
    assert row["frames_per_second"] > 0 and row["efficiency"] == row["work"] == 1.0
