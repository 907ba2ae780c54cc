"""Recordings in numbers."""

from pathlib import Path

from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.demonstrations.summary import recordings_table, summary


def test_a_row_tells_whose_the_actions_were_and_what_was_saved(recording):
    row = summary(Path("people/one"), recording)
    assert (row.name, row.scenario, row.policy, row.steps) == ("one", "skirmish", "coordinated", 12)
    assert row.acts == int(recording.by(Mover.PERSON).sum()) and 0 < row.corrections <= row.acts
    line = recordings_table([row]).splitlines()[-1]
    assert line.endswith(f"| 12 | {row.acts} | {row.corrections} | {100 * recording.saved:.1f} |")
    assert recordings_table([row._replace(saved=None)]).endswith(f"| {row.corrections} |  |")


def test_what_others_wrote_makes_no_row_and_rings_no_bell(recording):
    row = summary(Path("one"), recording)._replace(policy="\x1b]0;owned\x07\x1b[31mred\n| fake | row |" + "a" * 999)
    lines = recordings_table([row]).splitlines()
    assert len(lines) == 3 and "| red \\| fake \\| row \\|" in lines[-1] and "\x1b" not in lines[-1]
    cell = recordings_table([row._replace(policy="a" * 999)]).splitlines()[-1].split(" | ")[3]
    assert len(cell) == 80 and cell.startswith("aaa")
