"""The command probe."""

import pytest

from warp_torchrl.commands.probe import main, probe_table, read_probe
from warp_torchrl.evaluation.probe import Reading
from warp_torchrl.runs.config.construction import ConfigError


def test_a_command_line_is_read():
    asked = read_probe(["policy=outputs/run", "episodes=8", "scenario=scouts", "mechanics.radio.range=5"])
    assert (asked.policy, asked.episodes) == ("outputs/run", 8)
    assert asked.overrides == ("scenario=scouts", "mechanics.radio.range=5")
    with pytest.raises(ConfigError, match=r"episodes must be in \[2, 4096\], got 1"):
        read_probe(["policy=run", "episodes=1"])


def test_a_table_has_a_row_for_each_thing():
    printed = probe_table([Reading("its own row", 0.912, 0.3, 12)], "search").splitlines()
    assert printed[0].startswith("| what a message tells on `search`")
    assert printed[2:] == ["| its own row | 0.91 | 0.30 | 12 |"]


@pytest.mark.parametrize("policy", ["local", "weak"])
def test_a_policy_that_does_not_talk_is_refused_in_one_line(policy, weak_run, capsys):
    assert main([f"policy={weak_run if policy == 'weak' else policy}", "episodes=2"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: policy must be") and told.count("\n") == 1
