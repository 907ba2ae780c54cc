"""An episode is photographed, and what is wrong told what is wrong in one line."""

import shutil

import numpy as np
import pytest
from drawings import episode
from drawings.__main__ import main
from PIL import Image

from warp_torchrl.commands.failure import UNSOUND

SMALL = ["landscape.size=16", "--policy", "noop", "--seed", "3"]


@pytest.mark.parametrize(
    ("steps", "said"),
    [
        ("5:3", "must go on from the first step, by at least one at a time, got 5:3"),
        ("5:9:0", "must go on from the first step"),
        ("-1", "must be FIRST, FIRST:LAST or FIRST:LAST:EVERY"),
        ("1:2:3:4", "must be FIRST, FIRST:LAST or FIRST:LAST:EVERY, whole numbers, got 1:2:3:4"),
    ],
)
def test_steps_that_are_none_are_refused(capsys, steps, said):
    with pytest.raises(SystemExit) as end:
        main(["episode", "--steps", steps])
    assert end.value.code == 2 and said in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (["foo=1"], "error: foo is not a key of the configuration"),
        (["--policy", "locl"], "did you mean local?"),
        (["--seed", "-3"], "error: seed must be in [0"),
        (["--sharpness", "9"], "error: sharpness must be in 0.2..4, got 9.0"),
    ],
)
def test_a_mistake_ends_with_one_line(capsys, monkeypatch, tmp_path, given, said):
    monkeypatch.setattr(episode, "find_spec", lambda name: name)
    pytest.importorskip("viser", reason="needs the extra live")
    assert main(["episode", *given, "--steps", "1", "--out", str(tmp_path / "out")]) == 2
    errors = capsys.readouterr().err.splitlines()
    assert said in errors[-1] and len(errors) == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_that_is_no_run_ends_as_it_does_everywhere(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr(episode, "find_spec", lambda name: name)
    pytest.importorskip("viser", reason="needs the extra live")
    assert main(["episode", "--policy", "no/such/run", "--steps", "1", "--out", str(tmp_path / "out")]) == UNSOUND
    assert capsys.readouterr().err == "error: no/such/run is not a run folder: nothing there\n"


@pytest.mark.parametrize(
    ("missing", "said"), [("viser", 'pip install "warp_torchrl[live]"'), ("playwright", "pip install playwright")]
)
def test_what_is_not_installed_is_named(capsys, monkeypatch, missing, said):
    monkeypatch.setattr(episode, "find_spec", lambda name: None if name == missing else name)
    assert main(["episode"]) == 2
    assert said in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "name", "count"), [("2", "episode.png", 1), ("0:4:2", "episode.webp", 3)])
def test_a_step_is_a_picture_and_several_are_an_animation(tmp_path, steps, name, count):
    pytest.importorskip("viser", reason="needs the extra live")
    pytest.importorskip("playwright", reason="playwright is not installed")
    if not (shutil.which("chromium") or shutil.which("google-chrome")):
        pytest.skip("there is no Chromium here")
    assert main(["episode", *SMALL, "--steps", steps, "--sharpness", "0.5", "--out", str(tmp_path)]) == 0
    with Image.open(tmp_path / name) as picture:
        assert getattr(picture, "n_frames", 1) == count and picture.width == 450
        frames = []
        for index in range(count):
            picture.seek(index)
            frames.append(np.asarray(picture.convert("RGB")).astype(int))
    red, green, blue = np.moveaxis(frames[-1][:, 120:], -1, 0)
    assert ((green > red + 8) & (green > blue + 8)).mean() > 0.03, "forest"
    assert count == 1 or (np.abs(frames[0] - frames[-1]).max(axis=2) > 40).mean() > 0.002, "the fire goes on"
