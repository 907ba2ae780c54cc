"""The page: a server of this machine alone, and in a real browser what people do on it."""

import contextlib
import io
import re
import shutil
import socket
import threading
import time
from http.client import HTTPConnection
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

pytest.importorskip("viser", reason="needs the extra live")

from tests.live.conftest import SMALL
from warp_torchrl.demonstrations.files import read_recording
from warp_torchrl.demonstrations.recording import Mover
from warp_torchrl.live.address import Address
from warp_torchrl.live.crew import Refused
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.page import Page
from warp_torchrl.live.panel.tab import chosen_option
from warp_torchrl.live.replayed import ReplayedMatch
from warp_torchrl.runs.config.construction import ConfigError
from warp_torchrl.world.state.cells import is_tree
from warp_torchrl.world.state.state import Action

BROWSER = next((path for name in ("chromium", "google-chrome") if (path := shutil.which(name))), None)
FLAGS = ["--headless=new", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


@pytest.fixture
def page(request, tmp_path):
    """A page of a policy without probabilities; of another one where a test names it."""
    policy = getattr(request, "param", "noop")
    # No shipped policy was trained to see so far.
    overrides = (*SMALL, "observation.radius=4") if policy == "noop" else SMALL
    with Page(Setting(policy=policy, overrides=overrides), Address(port=0), tmp_path / "people") as made:
        yield made


def test_it_listens_to_this_machine_alone(page):
    host, port = page.address.host, page.address.port
    assert host == "127.0.0.1"
    with pytest.raises(ConnectionRefusedError), socket.socket() as other:
        other.connect(("127.0.0.2", port))  # another address of this machine, as a network's would be


def test_no_file_outside_of_the_browser_s_program_is_served(page):
    for path in ("/../../../../../../etc/passwd", "/%2e%2e/%2e%2e/%2e%2e/__init__.py", "//etc/passwd"):
        link = HTTPConnection(page.address.host, page.address.port, timeout=10)
        link.request("GET", path)
        answer = link.getresponse()
        body = answer.read()
        assert answer.status == 404 or (b"root:" not in body and b"import" not in body), path
        link.close()


def test_nothing_is_shared_when_a_browser_asks(page, monkeypatch):
    def tunnel(*given):
        raise AssertionError("a tunnel to the public network")

    monkeypatch.setattr("viser._viser.ViserTunnel", tunnel)
    assert page.server.request_share_url() is None


def test_a_port_that_another_program_has_is_refused(page):
    with pytest.raises(ConfigError, match=f"port {page.address.port} cannot be used on 127.0.0.1"):
        Page(Setting(policy="noop", overrides=SMALL), page.address)


def test_the_clock_plays_at_its_pace_and_stops_with_the_episode(page):
    page.playing, page.pace = True, 500.0
    clock = threading.Thread(target=page.play)
    clock.start()
    _until(lambda: page.match.ended)
    _until(lambda: not page.playing)
    page.stop()
    clock.join(timeout=10)
    assert not clock.is_alive() and int(page.match.alone.state.step[0]) > 5


def _until(holds, seconds=60.0):
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end, "it took too long"
        time.sleep(0.05)


def test_a_pace_that_is_none_is_refused(page):
    for pace in (0, -3, 31, float("nan"), float("inf")):
        with pytest.raises(ValueError, match=r"steps a second must be in 1\.\.30, got"):
            page.set_pace(pace)
    page.set_pace(30)
    assert page.pace == 30.0


def test_stop_ends_a_page_that_waits_for_its_next_step(page):
    page.pace = 1e-3
    clock = threading.Thread(target=page.play)
    clock.start()
    time.sleep(0.2)
    page.stop()
    clock.join(timeout=10)
    assert not clock.is_alive()


def test_an_act_of_the_page_s_own_that_fails_does_not_end_it(page, caplog):
    clock = threading.Thread(target=page.play)
    clock.start()
    page.inbox.put_alone(1, lambda: 1 / 0)
    _until(lambda: caplog.records)
    assert caplog.records[0].getMessage() == "ZeroDivisionError: division by zero" and clock.is_alive()
    page.stop()
    clock.join(timeout=10)


def test_a_match_that_cannot_be_shown_leaves_the_one_before(page, monkeypatch):
    before, other = page.match, Match(page.given)
    real = page._set_stages

    def fail():
        if page.match is other:
            raise MemoryError("a map of a million cells")
        real()

    monkeypatch.setattr(page, "_set_stages", fail)
    page.set_view("belief")
    with pytest.raises(MemoryError):
        page.open(other)
    assert page.match is before and page.view == "belief" and not page.playing
    page.step()


def test_a_match_that_fails_stands_still_and_the_page_stays(page, monkeypatch):
    def fail():
        raise RuntimeError("an ability of one's own\nhas a mistake")

    told = []
    monkeypatch.setattr(page.match, "step", fail)
    monkeypatch.setattr(page, "tell", lambda line, mistake=False: told.append((line, mistake)))
    page.playing, page.pace = True, 100.0
    clock = threading.Thread(target=page.play)
    clock.start()
    _until(lambda: told)
    assert told == [("RuntimeError: an ability of one's own has a mistake", True)] and not page.playing
    assert clock.is_alive()
    page.stop()
    clock.join(timeout=10)


def test_a_new_start_shows_the_ground_of_its_seed(page):
    before = page._stages[0].tiles.batched_colors.copy()
    page.restart(page.match.setting.seed + 1)
    assert (page._stages[0].tiles.batched_colors != before).any()
    page.restart(page.match.setting.seed - 1)
    assert (page._stages[0].tiles.batched_colors == before).all()


def test_a_browser_cannot_name_what_it_was_not_offered():
    offered = SimpleNamespace(value="/etc", options=("default", "local"), label="Policy")
    with pytest.raises(ValueError, match="Policy must be one of default, local, got /etc"):
        chosen_option(offered)
    offered.value = "local"
    assert chosen_option(offered) == "local"


def test_what_is_drawn_follows_the_match(page):
    stage, state = page._stages[0], page.match.sides[0].state
    row, column = (is_tree(state.cells[0]) & (state.cells[0] > 3)).nonzero()[-1].tolist()
    before = stage.tiles.batched_colors.copy()
    page.match.ignite(row, column)
    page.show()
    changed = (stage.tiles.batched_colors != before).any(axis=1).nonzero()[0].tolist()
    assert changed == [row * 16 + column]


# What was played


@pytest.fixture
def kept(page):
    """A page that keeps episodes in an empty folder, and a function that drives a vehicle for a step."""
    page.keeper.every = True

    def drive():
        crew = page.match.sides[0].crew
        crew.take(0, person=1)
        crew.press(0, 1, int(Action.SOUTH))
        page.step()

    return page, drive


def saved(page):
    return sorted(path.name for path in page.keeper.folder.glob("*"))


def test_an_episode_with_people_is_kept_when_it_is_left_and_one_without_is_not(kept):
    page, drive = kept
    page.step()
    page.restart()
    assert saved(page) == []
    drive()
    page.restart()
    assert saved(page) == ["skirmish-1000000-1"]
    drive()
    page.open(Match(page.given))
    assert len(saved(page)) == 2
    drive()
    while not page.match.sides[0].ended:
        page.step()
    assert len(saved(page)) == 3 and len(page.keeper.read("skirmish-1000000-3").steps) > 5
    page.step()
    page.restart()
    assert len(saved(page)) == 3, "it is kept once"


def test_the_end_of_the_page_keeps_the_episode_and_says_so(kept, capsys):
    page, drive = kept
    drive()
    page.__exit__()
    assert saved(page) == ["skirmish-1000000-1"]
    assert capsys.readouterr().out == f"saved {page.keeper.folder / 'skirmish-1000000-1'}\n"


def test_an_episode_that_cannot_be_saved_is_not_left_and_its_end_is_told_once(kept, monkeypatch):
    page, drive = kept
    told = []
    monkeypatch.setattr(page, "tell", lambda line, mistake=False: told.append(line))
    page.keeper.folder.write_text("a file")
    drive()
    open_recording = page.match.sides[0].open_recording
    for leave in (page.restart, lambda: page.open(Match(page.given))):
        with pytest.raises(Refused, match="cannot be written"):
            leave()
    assert page.match.sides[0].open_recording is open_recording and told == []
    while not page.match.ended:
        page.step()
    assert len(told) == 1 and "this episode is not saved" in told[0]
    page.keeper.every = False
    page.restart()
    assert page.match.sides[0].open_recording is not open_recording


def test_a_recording_is_watched_and_the_match_is_loaded_again(kept):
    page, drive = kept
    drive()
    page.restart()
    page.open(ReplayedMatch(page.keeper.read("skirmish-1000000-1"), page.match.setting))
    page.playing, page.pace = True, 500.0
    page._go_on()
    assert page.match.ended and not page.playing and int(page.match.sides[0].state.step[0]) == 1
    page.open(Match(page.match.setting))
    assert len(saved(page)) == 1


def test_the_page_tells_how_far_a_training_is_and_ends_it(page, monkeypatch):
    told = []
    monkeypatch.setattr(page, "tell", lambda line, mistake=False: told.append(line))
    states = iter(["one trains", "one trains", "one is trained"])
    monkeypatch.setattr(page.learning, "status", lambda: next(states))
    for _ in range(3):
        page._followed = -1e9
        page._go_on()
    assert told == ["one trains", "one is trained"]
    ended = []
    monkeypatch.setattr(page.learning, "close", lambda: ended.append(True))
    page.__exit__()
    assert ended == [True]


# In a browser


@pytest.fixture
def browser(page):
    sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    if BROWSER is None:
        pytest.skip("there is no Chromium here")
    clock = threading.Thread(target=page.play)
    clock.start()
    with sync_api.sync_playwright() as driver:
        made = driver.chromium.launch(executable_path=BROWSER, args=FLAGS)
        yield made
        made.close()
    page.stop()
    clock.join(timeout=10)


def _open(browser, page):
    tab = browser.new_page(viewport={"width": 1200, "height": 800})
    tab.set_default_timeout(120_000)  # without a graphics card a picture takes long
    tab.goto(page.url)
    tab.get_by_role("tab", name="Drive").wait_for(timeout=120_000)
    return tab


@pytest.mark.slow
def test_a_person_watches_a_fire_grow_drives_a_vehicle_puts_out_a_cell_and_leaves(page, browser):
    tab, side = _open(browser, page), page.match.sides[0]
    tab.get_by_role("button", name="Step", exact=True).click()
    tab.get_by_text(re.compile("step 1 of 30")).wait_for(timeout=30_000)

    tab.get_by_role("tab", name="Drive").click()
    tab.keyboard.press("f")
    tab.get_by_text("take it over first").first.wait_for(timeout=30_000)
    assert int(side.state.step[0]) == 1, "what is refused is no step"

    tab.get_by_role("button", name="Take over", exact=True).click()
    _until(lambda: side.crew.seats[0].person is not None)
    with page.lock:
        row, column = side.state.vehicles.position[0, 0].tolist()
        while not is_tree(side.state.cells)[0, row, column]:
            page.restart(page.match.setting.seed + 1)
            row, column = side.state.vehicles.position[0, 0].tolist()
        before = side.curves.burning[-1]
        page.match.ignite(row, column)
        page.show()
    assert side.curves.burning[-1] > before
    tab.keyboard.press("f")
    _until(lambda: int(side.curves.extinguished[0]) == 1)
    assert bool(side.state.extinguished[0, row, column])

    tab.get_by_role("button", name="Play", exact=True).click()
    _until(lambda: int(side.state.step[0]) > 8)
    assert page.match.alone.curves.saved[-1] < page.match.alone.curves.saved[0], "the fire grows"
    tab.close()
    _until(lambda: side.crew.seats[0].person is None)


@pytest.mark.slow
def test_the_picture_shows_forest_and_fire(page, browser):
    tab = _open(browser, page)
    _until(lambda: _share(tab, FOREST) > 0.05)
    before = _share(tab, BURNING)
    with page.lock:
        for index in page._stages[0].ground.trees[::3].tolist():
            with contextlib.suppress(ValueError):  # a tree that cannot be lit
                page.match.ignite(index // 16, index % 16)
        page.show()
    _until(lambda: _share(tab, BURNING) > before + 0.02)


@pytest.mark.slow
def test_a_click_on_the_ground_lights_the_cell_that_was_clicked_and_one_in_the_sky_none(page, browser):
    tab, before = _open(browser, page), page.match.alone.state.cells.clone()
    tab.get_by_role("tab", name="World").click()
    tab.get_by_label("A click on a cell").click()
    tab.get_by_role("option", name="lights it", exact=True).click()
    _until(lambda: _share(tab, FOREST) > 0.05)

    def lit():
        return ((page.match.alone.state.cells > 10) & (before <= 10))[0].nonzero().tolist()

    tab.mouse.click(60, 60)
    for x, y in ((420, 420), (360, 440), (300, 460), (480, 420)):  # one of them may be bare
        tab.mouse.click(x, y)
        time.sleep(1.0)
        if lit():
            break
    panel = next(iter(page._panels.values()))
    assert lit() == [[int(each) for each in panel.world.cell.value]]


FOREST, BURNING = "forest", "burning"


def _share(tab, what):
    """The share of the picture's pixels, left of the panel, that are green or are orange."""
    picture = np.asarray(Image.open(io.BytesIO(tab.screenshot())).convert("RGB").crop((0, 0, 840, 800))).astype(int)
    red, green, blue = picture[..., 0], picture[..., 1], picture[..., 2]
    found = (green > red + 8) & (green > blue + 8) if what == FOREST else (red > 190) & (red > blue + 70)
    return found.mean()


@pytest.mark.slow
def test_two_people_on_one_vehicle_the_second_is_told(page, browser):
    first, second = _open(browser, page), _open(browser, page)
    for tab in (first, second):
        tab.get_by_role("tab", name="Drive").click()
    first.get_by_role("button", name="Take over", exact=True).click()
    first.locator("strong", has_text="you").wait_for(timeout=30_000)
    second.get_by_role("button", name="Take over", exact=True).click()
    second.get_by_text("bulldozer_0 is driven by another person").first.wait_for(timeout=30_000)
    second.locator("strong", has_text="a person").wait_for(timeout=30_000)


@pytest.mark.slow
def test_the_match_waits_for_a_word_and_a_policy_that_does_not_fit_leaves_it(page, browser):
    tab = _open(browser, page)
    with page.lock:
        page.match.sides[0].crew.ask_before(["stay"])
        page.show()
    tab.get_by_text("is about to").first.wait_for(timeout=30_000)
    tab.get_by_role("button", name="Play", exact=True).click()
    time.sleep(1.0)
    assert int(page.match.alone.state.step[0]) == 0
    tab.get_by_role("button", name="Pause", exact=True).click()
    _until(lambda: not page.playing)
    tab.get_by_role("button", name="Don't", exact=True).click()
    _until(lambda: int(page.match.alone.state.step[0]) == 1)
    assert (page.match.sides[0].state.vehicles.last_action == int(Action.STAY)).all()

    match = page.match
    tab.get_by_role("tab", name="Match").click()
    tab.get_by_label("Policy").click()
    tab.get_by_role("option", name="default", exact=True).click()
    tab.get_by_role("button", name="Load", exact=True).click()
    tab.get_by_text("the policy default does not fit here").first.wait_for(timeout=30_000)
    assert page.match is match


@pytest.mark.slow
def test_a_person_drives_by_the_keyboard_saves_what_was_played_and_watches_it(page, browser):
    tab, side = _open(browser, page), page.match.sides[0]
    tab.get_by_role("tab", name="Drive").click()
    tab.get_by_role("button", name="Take over", exact=True).click()
    _until(lambda: side.crew.seats[0].person is not None)
    for count, key in enumerate("ss", start=1):
        tab.keyboard.press(key)
        _until(lambda steps=count: len(side.open_recording.rows) == steps)
    tab.get_by_role("tab", name="Record").click()
    tab.get_by_role("button", name="Save what was played", exact=True).click()
    folder = page.keeper.folder / "skirmish-1000000-1"
    tab.get_by_text(f"saved {folder}").first.wait_for(timeout=30_000)
    assert read_recording(folder).by(Mover.PERSON)[:, 0].all()
    tab.get_by_role("cell", name="skirmish-1000000-1").wait_for(timeout=30_000)

    tab.get_by_role("button", name="Watch it", exact=True).click()
    _until(lambda: isinstance(page.match, ReplayedMatch))
    tab.get_by_role("tab", name="Drive").click()
    tab.get_by_role("button", name="Take over", exact=True).click()
    tab.get_by_text("a recording is watched as it was played").first.wait_for(timeout=30_000)
    tab.get_by_role("button", name="Play", exact=True).click()
    _until(lambda: page.match.ended)
    assert int(page.match.sides[0].state.step[0]) == 2


@pytest.mark.slow
def test_a_full_disk_is_told_and_the_match_goes_on(page, browser):
    tab = _open(browser, page)
    page.keeper.folder.write_text("no folder")
    tab.get_by_role("button", name="Step", exact=True).click()
    tab.get_by_role("tab", name="Record").click()
    tab.get_by_role("button", name="Save what was played", exact=True).click()
    tab.get_by_text("this episode is not saved").first.wait_for(timeout=30_000)
    tab.get_by_role("button", name="Step", exact=True).click()
    _until(lambda: int(page.match.alone.state.step[0]) == 2)


@pytest.mark.slow
@pytest.mark.parametrize("page", ["default"], indirect=True)
def test_a_person_answers_by_keys_where_the_policy_is_unsure(page, browser):
    tab, side = _open(browser, page), page.match.sides[0]
    with page.lock:
        side.ask_where_unsure(1.0)
        page.show()
        questions = page.match.questions()
        if len(questions) > 1:  # answer all but the last here
            for question in questions[:-1]:
                side.crew.answer(question, True)
            page.show()
        asked = page.match.questions()[0]
        stay = side.env.action_names.index("stay")
    tab.get_by_text(f"What should {side.env.agent_names[asked.agent]} do?").first.wait_for(timeout=30_000)
    tab.keyboard.press("s")
    _until(lambda: len(side.open_recording.rows) == 1)
    row = side.open_recording.rows[0]
    assert int(row["agents", "action"][asked.agent]) == stay
    assert int(row["agents", "mover"][asked.agent]) == Mover.PERSON

    _until(lambda: page.match.questions())
    while len(side.open_recording.rows) == 1:
        before = len(page.match.questions())
        tab.keyboard.press("g")
        _until(lambda left=before: len(side.open_recording.rows) == 2 or len(page.match.questions()) < left)
    row = side.open_recording.rows[1]
    agreed = row["agents", "mover"] == Mover.PERSON
    assert agreed.any() and row["agents", "action"].equal(row["agents", "proposed"])
