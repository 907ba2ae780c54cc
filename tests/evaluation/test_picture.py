"""An episode as a file: all kinds show the same one."""

import pytest
from PIL import Image

from warp_torchrl import make_env
from warp_torchrl.evaluation.picture import record_episode, write_video
from warp_torchrl.heuristics import HEURISTICS

SEED = 1_000_000


@pytest.fixture
def env():
    return make_env("skirmish", n_worlds=1, seed=SEED, overrides=["landscape.size=12", "horizon=12"])


def record(env, path, kind):
    record_episode(path, kind, env, HEURISTICS["random"](env), "small\nrandom", SEED, "sampled")
    return path


def decoded(path):
    """The pictures of a film, RGB."""
    av = pytest.importorskip("av", reason="needs the extra video")
    with av.open(str(path)) as film:
        return film.streams.video[0].codec_context.name, [each.to_image() for each in film.decode(video=0)]


@pytest.mark.slow
def test_a_video_shows_what_the_gif_shows(env, tmp_path):
    pytest.importorskip("av", reason="needs the extra video")
    codec, film = decoded(record(env, tmp_path / "episode.mp4", "mp4"))
    with Image.open(record(env, tmp_path / "episode.gif", "gif")) as gif:
        last = gif.n_frames - 1
        assert codec == "h264" and len(film) == last + 2000 // 120, "the last picture stands for two seconds"
        for index in (0, last // 2, last):
            gif.seek(index)
            shown = film[index].resize(gif.size, Image.Resampling.BOX)
            errors = [abs(a - b) for a, b in zip(shown.tobytes(), gif.convert("RGB").tobytes())]
            assert sum(errors) / len(errors) < 4.0
    assert sorted(each.name for each in tmp_path.iterdir()) == ["episode.gif", "episode.mp4"]


def test_sides_of_a_video_are_even_and_players_can_start_before_its_end(tmp_path):
    pytest.importorskip("av", reason="needs the extra video")
    frames = [(Image.new("RGB", (33, 21), colour), 120) for colour in ("red", "blue")]
    write_video(tmp_path / "episode.mp4", frames)
    _, film = decoded(tmp_path / "episode.mp4")
    assert [each.size for each in film] == [(66, 42)] * 2
    red, _, blue = film[0].getpixel((30, 20))
    assert red > 200 and blue < 60
    content = (tmp_path / "episode.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")


def test_a_video_that_fails_leaves_the_old_one(tmp_path):
    pytest.importorskip("av", reason="needs the extra video")
    (tmp_path / "episode.mp4").write_text("old")
    with pytest.raises(AttributeError):
        write_video(tmp_path / "episode.mp4", [(Image.new("RGB", (8, 8)), 120), (None, 120)])
    assert (tmp_path / "episode.mp4").read_text() == "old" and len(list(tmp_path.iterdir())) == 1
