"""What was played is saved once, and only where people did something."""

import shutil

import pytest

from warp_torchrl.demonstrations.files import MANIFEST, read_recording
from warp_torchrl.live.crew import Refused
from warp_torchrl.live.keeping import Keeper
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.world.state.state import Action


@pytest.fixture
def match(make_match):
    return make_match("noop")


@pytest.fixture
def keeper(tmp_path):
    made = Keeper(tmp_path / "people")
    made.every = True
    return made


def drive(match, steps=2):
    side = match.sides[0]
    side.crew.take(0, person=1)
    for _ in range(steps):
        side.crew.press(0, 1, int(Action.SOUTH))
        match.step()
    return side


def folders(keeper):
    return sorted(path.name for path in keeper.folder.iterdir()) if keeper.folder.exists() else []


def test_an_episode_without_people_is_not_kept_and_one_with_them_is(match, keeper):
    match.step()
    side = match.sides[0]
    assert keeper.keep(side) is None and folders(keeper) == []
    drive(match)
    assert len(read_recording(keeper.keep(side)).steps) == 3


def test_nothing_is_kept_that_nobody_asked_to_keep_and_a_button_saves_all(match, keeper):
    keeper.every = False
    assert keeper.keep(drive(match)) is None
    match.restart()
    match.step()
    assert len(read_recording(keeper.save(match.sides[0])).steps) == 1, "also without people"


def test_what_is_saved_again_takes_the_place_of_what_was_saved_before(match, keeper):
    side = drive(match)
    keeper.save(side)
    assert keeper.keep(side) is None, "all of it is saved"
    drive(match)
    second = keeper.keep(side)
    assert folders(keeper) == [second.name] and len(read_recording(second).steps) == 4
    match.restart()
    drive(match)
    keeper.keep(side)
    assert len(folders(keeper)) == 2, "another episode has a folder of its own"


def test_a_change_of_the_world_is_an_act_too(match, keeper):
    match.step()
    match.blow(3.0, 90.0)
    assert len(read_recording(keeper.keep(match.sides[0])).events) == 1
    match.restart()
    match.blow(3.0, 90.0)
    assert keeper.keep(match.sides[0]) is None, "no step was played"


def test_a_full_disk_is_one_line_and_what_was_saved_before_stays(match, keeper, monkeypatch):
    side = drive(match)
    first = keeper.save(side)
    drive(match)

    def full(*given):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.posix_fallocate", full, raising=False)
    with pytest.raises(Refused, match=r"cannot be written \(No space left on device\)"):
        keeper.keep(side)
    assert folders(keeper) == [first.name]
    monkeypatch.undo()
    assert len(read_recording(keeper.keep(side)).steps) == 4, "it is saved as soon as there is room"


def test_a_folder_that_cannot_be_made_is_one_line(match, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(Refused, match=r"file.* cannot be written"):
        Keeper(tmp_path / "file" / "people").save(drive(match))


def test_recordings_are_listed_with_their_numbers_and_a_broken_one_with_what_is_wrong(match, keeper):
    assert keeper.recordings() == ({}, 0)
    keeper.save(drive(match))
    match.restart()
    broken = keeper.save(drive(match, steps=3))
    (broken / MANIFEST).write_text("{}")
    sound, other = keeper.recordings()[0].values()
    assert (sound.steps, sound.acts, sound.corrections) == (2, 2, 2) and sound.saved == pytest.approx(1.0, abs=0.2)
    assert "format None" in other
    assert len(keeper.read("skirmish-1000000-1").steps) == 2
    with pytest.raises(Refused, match="holds no recording \\.\\./secret"):
        keeper.read("../secret")


def test_a_recording_whose_folder_has_a_name_of_markup_is_neither_listed_nor_read(match, keeper):
    sound = keeper.save(drive(match))
    strange = ("<iframe srcdoc=x>", "a b", "a`b", "{x}", "ü", "a\nb", "x/<b>", "<b>/x")
    for name in strange:
        shutil.copytree(sound, keeper.folder / name)
    shutil.copytree(sound, keeper.folder / "of-a.friend/B_2")
    found, left_out = keeper.recordings()
    assert list(found) == ["of-a.friend/B_2", sound.name] and left_out == len(strange)
    for name in strange:
        with pytest.raises(Refused, match="holds no recording"):
            keeper.read(name)


def test_what_another_has_saved_under_the_same_name_stays(match, keeper):
    side = drive(match)
    first = keeper.save(side)
    shutil.rmtree(first)
    match.restart()
    other = Keeper(keeper.folder).save(drive(match, steps=1))
    assert other == first
    side.open_recording = keeper._last[0]
    drive(match)
    second = keeper.save(side)
    assert folders(keeper) == sorted((other.name, second.name))


@pytest.mark.parametrize(
    "error", [ValueError("what was written is not what was played"), Unsound("broken"), MemoryError()]
)
def test_an_episode_whose_saving_fails_is_not_called_saved(match, keeper, monkeypatch, error):
    side = drive(match)

    def fail(*given):
        raise error

    monkeypatch.setattr("warp_torchrl.live.keeping.save_recording", fail)
    with pytest.raises(Refused if isinstance(error, Unsound) else type(error)):
        keeper.save(side)
    monkeypatch.undo()
    assert keeper.changes == 0 and keeper.keep(side) is not None, "it can still be saved"
