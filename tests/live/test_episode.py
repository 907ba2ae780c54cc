"""An episode as a file: what it shows and holds, and that a real browser plays it without a network."""

import html
import re
import shutil
import time

import numpy as np
import pytest
import torch

pytest.importorskip("viser", reason="needs the extra live")

from drawings.episode import _picture

from warp_torchrl.env.pictures.caption import progress
from warp_torchrl.evaluation.picture import record_episode
from warp_torchrl.evaluation.play import play
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.live.episode import Film, SceneRecorder, map_colours
from warp_torchrl.world.state.cells import is_burning
from warp_torchrl.world.world import World

SEED = 1_000_000
HOSTILE = "<script>alert('&')</script>"
BROWSER = next((path for name in ("chromium", "google-chrome") if (path := shutil.which(name))), None)
FLAGS = ["--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@pytest.fixture
def env(make_match):
    """An environment of one small world."""
    return make_match(policy="local").sides[0].env


class Watcher:
    """Keeps the states of an episode."""

    def __init__(self):
        self.states = []

    def add(self, state):
        self.states.append(state.clone())


def messages(film):
    """What a film holds, as pairs of a time and a message."""
    return film._film._messages


def film_of(env, recorder=None):
    recorder = recorder or SceneRecorder("small\nlocal", env)
    play(env, HEURISTICS["local"](env), SEED, recorder=recorder)
    return recorder


def test_a_file_has_all_that_it_needs_and_is_small(env, tmp_path):
    path = tmp_path / "episode.html"
    record_episode(path, "html", env, HEURISTICS["local"](env), "small\nlocal", SEED, "sampled")
    text = path.read_text()
    assert "window.__VISER_EMBED_DATA__=" in text and "<h1>small</h1><p>local</p>" in text
    assert "<title>small - local</title>" in text
    assert not re.search(r"<[^>]*\b(src|href)\s*=\s*['\"](?!data:)", text), "something outside of the file"
    assert set(re.findall(r"https?://[\w./-]+", text)) <= {"http://www.w3.org/2000/svg"}  # a name, not a place
    assert 0.5e6 < path.stat().st_size < 1.2e6
    assert [each.name for each in tmp_path.iterdir()] == ["episode.html"]


def test_all_names_are_text(make_match):
    match = make_match()
    film = Film(match.sides, [HOSTILE, f"policy {HOSTILE}"])
    film.add([HOSTILE])
    text = film.document()
    assert HOSTILE not in text and "alert('" not in text
    assert HOSTILE not in text and html.unescape(text).count(HOSTILE) == 4  # in the title and the heading


def test_it_shows_the_episode_that_an_evaluation_plays(env):
    watcher = Watcher()
    film_of(env, watcher)
    recorder = film_of(env)
    texts = [text for _, text in updates(recorder._film, "title", "text")]
    last = watcher.states[-1]
    assert texts[-1].startswith(f"step {int(last.step[0])} of 30:")
    assert len(watcher.states) == int(last.step[0]) + 1
    shares = [f"{float(is_burning(each.cells).sum() / each.initial.sum()):.0%} burning" for each in watcher.states]
    assert [text.split(", ")[1] for text in texts] == shares and len(set(shares)) > 3


def updates(film, node, key):
    """When a node's property has which value: pairs of a time and a value."""
    found = [(when, message) for when, message in messages(film) if message.get("name") == f"/side_0/{node}"]
    values = [(when, message.get("updates") or message.get("props") or {}) for when, message in found]
    return [(when, value[key]) for when, value in values if key in value and value[key] != ""]


def test_pictures_follow_each_other_in_time_and_the_last_one_stands(make_match):
    match = make_match()
    film = Film(match.sides, ["small"])
    film.add()
    for _ in range(4):
        match.step()
        film.add()
    assert [round(when, 3) for when, _ in updates(film, "title", "text")] == [0.0, 0.12, 0.24, 0.36, 0.48]
    film.document()
    assert film._film._time == pytest.approx(0.48 + 2.0)


def test_a_browser_begins_with_the_whole_map(make_match):
    match = make_match()
    kinds = {message["type"]: message for _, message in messages(Film(match.sides, ["small"]))}
    x, y, z = kinds["SetCameraPositionMessage"]["position"]
    assert y < -16 and z > 10 and abs(x) < 3, "from the south, and from above"
    assert abs(kinds["SetCameraLookAtMessage"]["look_at"][1]) < 1
    assert kinds["EnvironmentMapMessage"]["hdri_data"] is None, "viser's come from the network"


def test_vehicles_face_where_those_of_a_match_face(make_match):
    match = make_match(policy="local")
    side, recorder = match.sides[0], SceneRecorder("small", match.sides[0].env)
    seen = []
    while not side.ended:
        recorder.add(side.state)
        assert (recorder._side.facing == side.facing).all()
        seen.append(side.facing.clone())
        match.step()
    assert (seen[0] == -1).all() and len({tuple(each.tolist()) for each in seen}) > 3


def test_the_legend_names_what_is_on_the_map_and_each_vehicle(make_match):
    side = make_match().sides[0]
    names = list(map_colours(side))
    covers = {"lake", "wetland", "grassland", "forest", "bare"}
    there = {("lake", "wetland", "grassland", "forest", "bare")[code] for code in side.state.cover.unique().tolist()}
    assert set(names) & covers == there and "bare" not in names
    assert {"fire", "ash", "wet"} <= set(names)
    assert names[-3:] == ["B0  bulldozer_0", "B1  bulldozer_1", "B2  bulldozer_2"]
    assert re.fullmatch(r"step 0 of 30:  \d+% saved, \d+% burning", progress(side.state, side.env.world))


def test_houses_stand_where_worlds_have_some(make_match, monkeypatch):
    match = make_match()
    side = match.sides[0]
    assert "house" not in map_colours(side) and Film(match.sides, ["small"])._stages[0]._houses._handle is None
    left = torch.full(side.state.cells.shape, -1.0)
    left[0, 2, 3] = left[0, 4, 1] = 1.0
    monkeypatch.setattr(World, "buildings", lambda world, state: left)
    film = Film(match.sides, ["small"])
    assert (film._stages[0]._houses._handle.batched_scales[:, 2] > 0.1).sum() == 2
    assert {"house", "house, lost"} <= set(map_colours(side))


def test_nothing_seen_is_no_episode(env, tmp_path):
    with pytest.raises(ValueError, match="at least one state"):
        SceneRecorder("small", env).save(tmp_path / "episode.html")
    assert not list(tmp_path.iterdir())


# In a browser


@pytest.mark.slow
def test_a_browser_without_a_network_shows_forest_and_a_fire_that_changes(make_match, tmp_path):
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if BROWSER is None:
        pytest.skip("there is no Chromium here")
    match = make_match(policy="noop", overrides=("horizon=60",))
    film = Film(match.sides, [HOSTILE])
    film.add()
    while not match.ended:
        match.step()
        film.add()
    (tmp_path / "episode.html").write_text(film.document())
    asked, wrong = [], []
    with sync_api.sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=BROWSER, args=FLAGS)
        tab = browser.new_context(viewport={"width": 800, "height": 600}, offline=True).new_page()
        tab.on("request", lambda request: asked.append(request.url))
        tab.on("pageerror", lambda error: wrong.append(str(error)))
        tab.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
        tab.goto((tmp_path / "episode.html").as_uri())
        tab.locator("h1", has_text=HOSTILE).wait_for(timeout=60_000)
        clock = tab.locator("input").first
        clock.wait_for(timeout=60_000)
        began = clock.input_value()
        end = time.monotonic() + 60.0
        while clock.input_value() == began:
            assert time.monotonic() < end, "it does not play by itself"
            time.sleep(0.1)
        clock.fill("0.05")  # which stops it too: software draws slowly
        tab.wait_for_timeout(5000)  # until shapes and letters are there
        first, later = (_picture(tab, clock, second) for second in (0.05, 3.0))
        browser.close()
    assert not wrong
    assert share(first, "forest") > 0.05 and share(later, "forest") < share(first, "forest")
    assert max(share(first, "fire"), share(later, "fire")) > 0.005
    assert abs(share(later, "fire") - share(first, "fire")) > 0.002
    assert all(url.startswith(("file://", "blob:", "data:")) for url in asked), asked


def share(picture, what):
    """The share of a picture's pixels, right of the legend, that are green or are orange."""
    pixels = np.asarray(picture.crop((200, 60, picture.width, picture.height))).astype(int)
    red, green, blue = pixels[..., 0], pixels[..., 1], pixels[..., 2]
    found = (green > red + 8) & (green > blue + 8) if what == "forest" else (red > 190) & (red > blue + 70)
    return found.mean()
