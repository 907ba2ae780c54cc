"""The command that lists, checks and exports recordings."""

import shutil
import subprocess
import sys

import numpy as np
import pytest

from warp_torchrl.commands.demonstrations import main
from warp_torchrl.commands.failure import DISK, DONE, MISTAKE, UNSOUND
from warp_torchrl.demonstrations.files import MANIFEST, save_recording
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.world.state.state import Action


def played(people, *overrides):
    """Record three steps of two vehicles, of which a person drives the first."""
    match = Match(Setting(policy="noop", overrides=("landscape.size=12", "horizon=20", *overrides)))
    side = match.sides[0]
    side.crew.take(0, person=1)
    for _ in range(3):
        side.crew.press(0, 1, int(Action.SOUTH))
        match.step()
    return save_recording(side.record(), people)


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    people = tmp_path_factory.mktemp("two") / "people"
    return people, [played(people, "team.n_agents=2") for _ in range(2)]


@pytest.fixture
def people(two, tmp_path):
    """A copy of two recordings, which a test may break."""
    return shutil.copytree(two[0], tmp_path / "people")


def test_it_lists_what_there_is(people, capsys):
    assert main([str(people)]) == DONE
    rows = capsys.readouterr().out.splitlines()
    assert len(rows) == 4 and rows[2].startswith("| skirmish-1000000-1 | skirmish | 1000000 | noop | 3 | 3 | 3 | ")
    assert main([str(people / "skirmish-1000000-2")]) == DONE
    assert "skirmish-1000000-1" not in capsys.readouterr().out


def test_it_plays_them_again(people, capsys):
    assert main([str(people), "check=true"]) == DONE
    assert capsys.readouterr().out.endswith("2 of 2 play again as they were recorded\n")


def test_what_differs_is_told_and_the_others_are_listed(people, capsys):
    path = next((people / "skirmish-1000000-1").rglob("reward.memmap"))
    path.write_bytes(bytes(path.stat().st_size))
    assert main([str(people), "check=true", f"export={people / 'all.npz'}"]) == UNSOUND
    out, err = capsys.readouterr()
    assert "skirmish-1000000-2" in out and len(err.splitlines()) == 1
    assert err.startswith("error: skirmish-1000000-1: ") and err.endswith("; nothing was written\n")
    assert not (people / "all.npz").exists()


def test_check_plays_and_a_list_does_not(people, monkeypatch, capsys):
    def differs(self):
        raise Unsound("step 2 of the recording is not what this version plays: view differs")

    monkeypatch.setattr("warp_torchrl.demonstrations.replay.Replay.check", differs)
    assert main([str(people)]) == DONE
    assert main([str(people), "check=true"]) == UNSOUND
    assert capsys.readouterr().err.count("view differs") == 2


def test_it_exports_arrays_without_pickles(people, capsys):
    path = people / "all.npz"
    assert main([str(people), f"export={path}"]) == DONE
    assert capsys.readouterr().out.endswith(f"wrote 6 steps into {path}\n")
    with np.load(path, allow_pickle=False) as found:
        assert found["agents/action"].shape == found["agents/proposed"].shape == (6, 2)
        assert found["agents/action"][:, 0].tolist() == [int(Action.SOUTH)] * 6
        assert found["agents/mover"].tolist() == [[2, 0]] * 6
        assert found["next/agents/reward"].shape == (6, 2, 1) and found["agents/observation/view"].ndim == 5
        assert found["episode"].tolist() == [0, 0, 0, 1, 1, 1] and found["step"].tolist() == [0, 1, 2] * 2
        assert found["agents"].tolist() == ["bulldozer_0", "bulldozer_1"] and len(found["actions"]) == 11
        assert found["scenarios"].tolist() == ["skirmish"] * 2
    assert main([str(people), f"export={path}"]) == MISTAKE
    assert "overwrite=true" in capsys.readouterr().err
    assert main([str(people), f"export={path}", "overwrite=true"]) == DONE


def test_teams_of_other_shapes_are_not_exported_together(people, capsys):
    played(people, "team.n_agents=3")
    assert main([str(people), f"export={people / 'all.npz'}"]) == MISTAKE
    assert "teams of one shape" in capsys.readouterr().err and not (people / "all.npz").exists()


@pytest.mark.parametrize(
    ("arguments", "code", "says"),
    [
        ([], MISTAKE, "one folder of recordings is expected, got none"),
        (["one", "two"], MISTAKE, "got one two"),
        (["one", "checks=true"], MISTAKE, "did you mean check?"),
        (["one", "check=maybe"], MISTAKE, "check must be true or false, got 'maybe'"),
        (["one", "export=all.csv"], MISTAKE, "export must be a file that ends in .npz, got all.csv"),
        (["one", "--check"], MISTAKE, "keys are given as check="),
        (["nowhere"], UNSOUND, f"nowhere holds no recording: no {MANIFEST}"),
    ],
)
def test_a_mistake_is_one_line(arguments, code, says, capsys):
    assert main(arguments) == code
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("error: ") and len(err.splitlines()) == 1 and says in err


def test_a_folder_that_cannot_be_written_is_told(people, capsys):
    assert main([str(people), f"export={people}/nowhere/all.npz"]) == DISK
    assert capsys.readouterr().err == f"error: {people}/nowhere/all.npz: No such file or directory\n"


@pytest.mark.slow
def test_it_is_a_program(people):
    command = [sys.executable, "-m", "warp_torchrl", "demonstrations", str(people)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0 and done.stdout.count("skirmish-") == 2 and done.stderr == ""


def test_it_films_one_recording(people, capsys):
    pytest.importorskip("viser", reason="needs the extra live")
    one, path = people / "skirmish-1000000-1", people / "one.html"
    assert main([str(one), f"html={path}"]) == DONE
    assert capsys.readouterr().out.endswith(f"wrote {path}\n")
    assert "noop and people, seed 1000000" in path.read_text() and path.stat().st_size < 3_000_000


def test_a_film_of_several_or_into_another_kind_of_file_is_refused(people, capsys):
    pytest.importorskip("viser", reason="needs the extra live")
    assert main([str(people), f"html={people / 'all.html'}"]) == MISTAKE
    assert main([str(people / "skirmish-1000000-1"), f"html={people / 'one.gif'}"]) == MISTAKE
    several, kind = capsys.readouterr().err.splitlines()
    assert f"html must be of one recording, and {people} holds 2" in several and "html must be a file" in kind
    assert not list(people.glob("*.html"))
