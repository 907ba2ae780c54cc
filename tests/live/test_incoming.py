"""What a browser sends: a page lives on whatever it is, and its controls have values that they can have."""

import math
import threading
import time
from types import SimpleNamespace

import msgspec
import pytest

pytest.importorskip("viser", reason="needs the extra live")

import viser

from tests.live.browser import CAMERA, Browser, until
from tests.live.conftest import SMALL
from warp_torchrl.live import incoming
from warp_torchrl.live.address import Address
from warp_torchrl.live.crew import Refused
from warp_torchrl.live.door import MOST_MESSAGES
from warp_torchrl.live.match import Setting
from warp_torchrl.live.page import Page

NAN, INF = math.nan, math.inf
CLICK = {
    "type": "SceneNodeClickMessage", "name": "/side_0/tiles", "instance_index": None, "ray_origin": (0.0, 0.0, 9.0),
    "ray_direction": (0.0, 0.0, -1.0), "screen_pos": (0.5, 0.5), "modifier": None, "owner": "",
}  # fmt: skip


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    setting = Setting(policy="noop", overrides=(*SMALL, "observation.radius=4", "horizon=100000"))
    with Page(setting, Address(port=0), tmp_path_factory.mktemp("people") / "people") as made:
        clock = threading.Thread(target=made.play)
        clock.start()
        yield made
        made.stop()
        clock.join(timeout=10)
        assert not clock.is_alive()


@pytest.fixture
def browser(page):
    """Connect a browser; all are closed at the end, and what they asked for is dropped before the next test."""
    made = []

    def connect(**options):
        made.append(Browser(page.address.port, page.address.token, **options))
        return made[-1]

    yield connect
    for each in made:
        each.close()
    until(lambda: not page._clients)


def gui_of(page):
    return list(page._clients.values())[-1].gui


def steps(page):
    return int(page.match.alone.state.step[0])


def is_well(page, browser):
    """Whether a new browser has a page, and a step is made when it asks for one."""
    visitor, before = browser(), steps(page)
    visitor.press("Step")
    until(lambda: steps(page) > before)
    return True


@pytest.mark.parametrize(
    "message",
    [
        b"", b"\xc1", b"hello", b"\x91" * 60_000 + b"\xc0", b"\xdf\xff\xff\xff\xff", 5, [], {}, {"type": 5}, {"x": 1},
        {"type": "NoSuchMessage"}, {"type": "GuiUpdateMessage"}, {"type": "RunJavascriptMessage", "source": "alert(1)"},
        {"type": "FileTransferStartUpload", "source_component_uuid": "u", "transfer_uuid": "t", "filename": "../x",
         "mime_type": "x", "part_count": 10**9, "size_bytes": 10**12},
        {"type": "GuiButtonHoldMessage", "uuid": "u", "frequency": 1.0}, {"type": "ShareUrlRequest"},
        {"type": "GuiUpdateMessage", "uuid": "no such control", "updates": {"value": 1}},
        {"type": "GuiUpdateMessage", "uuid": ["u"], "updates": {"value": 1}},
        {"type": "GuiUpdateMessage", "uuid": "u", "updates": [1]},
        {**CAMERA, "wxyz": ()}, {**CAMERA, "fov": "x"}, {**CAMERA, "fov": NAN}, {**CAMERA, "position": (INF, 0.0, 0.0)},
        {**CAMERA, "far": 1e300}, {**CAMERA, "image_height": 2**63}, {**CAMERA, "more": 1},
        {**CLICK, "ray_origin": (NAN,) * 3}, {**CLICK, "ray_direction": (0.0, 0.0)}, {**CLICK, "modifier": "rm"},
        {**CLICK, "ray_origin": (1e12, 0.0, 0.0)}, {**CLICK, "name": "x" * 1000}, {**CLICK, "instance_index": 1.5},
        {"type": "CommandTriggerMessage", "uuid": "x" * 1000}, {"type": "CommandTriggerMessage", "uuid": None},
    ],
)  # fmt: skip
def test_a_message_that_no_page_sends_is_refused(page, browser, message):
    raw = message if isinstance(message, bytes) else msgspec.msgpack.encode(message)
    gui = gui_of(page) if page._clients else None
    with pytest.raises(Refused) as caught:
        incoming.check(raw, gui)
    assert len(str(caught.value)) < 500 and "\n" not in str(caught.value)


def test_what_a_page_sends_is_let_in(page, browser):
    browser()
    gui = gui_of(page)
    for message in (CAMERA, CLICK, {**CLICK, "modifier": "shift"}, {"type": "CommandTriggerMessage", "uuid": "u"}):
        incoming.check(msgspec.msgpack.encode(message), gui)
    incoming.check(msgspec.msgpack.encode(CAMERA), None)
    for control in (each for each in gui._gui_input_handle_from_uuid.values() if not each.disabled):
        button = isinstance(control, viser.GuiButtonHandle)
        value = list(control.value) if isinstance(control.value, tuple) else control.value
        incoming.check_value(control, True if button else value)


WRONG = (
    None,
    "x",
    "",
    NAN,
    INF,
    -INF,
    1e300,
    -1e300,
    2**63,
    -1,
    0.5,
    [],
    [1],
    [1, 2, 3],
    [NAN, 0.0],
    ["a", "b"],
    {},
    b"x",
)


def test_no_control_takes_what_it_cannot_have(page, browser):
    browser()
    controls = gui_of(page)._gui_input_handle_from_uuid.values()
    kinds = {type(each).__name__ for each in controls}
    assert len(kinds) == 7, f"a kind of control that this test does not know: {kinds}"
    for control in controls:
        for value in (*WRONG, True, [-1, 0], [0, 1e9], 10**8 + 1, 5000):
            if value is True and isinstance(control, viser.GuiCheckboxHandle | viser.GuiButtonHandle):
                continue
            if (control.label, value) in (("Seed", 5000), ("Seed", 10**8 + 1), ("Steps", 5000), ("m/s", 0.5)):
                continue
            with pytest.raises(incoming.Misfit):
                incoming.check_value(control, value)
    for value in (0, 1, "true", None):
        for control in controls:
            if isinstance(control, viser.GuiCheckboxHandle | viser.GuiButtonHandle):
                with pytest.raises(incoming.Misfit):
                    incoming.check_value(control, value)


def test_a_control_that_is_disabled_or_of_an_unknown_kind_takes_nothing(page, browser):
    browser()
    control = next(each for each in gui_of(page)._gui_input_handle_from_uuid.values() if each.label == "Seed")
    control.disabled = True
    with pytest.raises(incoming.Misfit, match="cannot be changed now"):
        incoming.check_value(control, 1)
    control.disabled = False
    incoming.check_value(control, 1)
    with pytest.raises(incoming.Misfit, match="cannot be changed by a browser"):
        incoming.check_value(gui_of(page).add_text("Text", "x"), "y")


@pytest.mark.parametrize("pace", [0, -3, 60, NAN])
def test_a_value_that_is_refused_is_told_put_back_and_changes_nothing(page, browser, pace):
    one, other = browser(), browser()
    one.set("Steps a second", pace)
    until(lambda: one.told)
    assert one.told[0].startswith("Steps a second must be a whole number in 1..30, got ") and other.told == []
    until(lambda: one.value("Steps a second") == 8)
    assert page.pace == 8.0
    assert is_well(page, browser)


def test_a_message_that_is_refused_has_it_that_the_next_ones_go_on(page, browser, caplog):
    one = browser()
    for _ in range(100):
        one.send(b"\xc1 rubbish")
        one.send(
            {"type": "GuiUpdateMessage", "uuid": one.find("Policy"), "updates": {"options": ["/etc"], "value": "/etc"}}
        )
    one.send("a text")
    before = steps(page)
    one.press("Step")
    until(lambda: steps(page) > before)
    assert len(one.told) == 20 and "more of it is not told" in caplog.text and len(caplog.records) == 20
    assert "a message changes more of a control than its value" in one.told


def test_a_browser_that_sends_much_is_slowed(page, browser):
    one, began = browser(), time.monotonic()
    for _ in range(150):
        one.send(CAMERA)
    one.set("Seed", -5)
    until(lambda: one.told)
    assert time.monotonic() - began > 0.95 * (150 - 50) / MOST_MESSAGES


def test_others_are_served_while_one_asks_for_much(page, browser):
    one, other = browser(), browser()
    before = steps(page)
    for _ in range(400):
        one.press("Step")
    other.set("Steps a second", 0)
    until(lambda: other.told, seconds=5.0)
    until(lambda: any("cannot keep up" in each for each in one.told))
    assert is_well(page, browser) and steps(page) - before < 400


def test_a_message_that_is_too_long_ends_its_own_connection_alone(page, browser):
    one, other = browser(), browser()
    one.send(bytes(100_000))
    until(lambda: one.link.close_code is not None)
    assert one.link.close_code == 1009
    other.set("Seed", 5)
    assert is_well(page, browser)


def test_an_act_that_fails_is_told_to_who_asked_for_it_and_the_page_goes_on(page, browser, monkeypatch, caplog):
    one, other = browser(), browser()

    def fail():
        raise ZeroDivisionError("a mistake\nof ours \x1b[31m")

    with monkeypatch.context() as patch:
        patch.setattr(page.match, "step", fail)
        one.press("Step")
        until(lambda: one.told)
    assert one.told == ["ZeroDivisionError: a mistake of ours"] and other.told == []
    assert [each.getMessage() for each in caplog.records] == one.told
    assert is_well(page, browser)


@pytest.mark.parametrize("button", ["Pause", "Step"])
def test_a_match_stands_still_after_pause_and_after_a_step(page, browser, button):
    one = browser()
    one.press("Play")
    until(lambda: page.playing)
    one.press(button)
    until(lambda: not page.playing)


def test_keys_in_quick_order_are_done_in_that_order(page, browser):
    one, side = browser(), page.match.sides[0]
    one.press("Take over")
    until(lambda: side.crew.seats[0].person is not None)
    acts = []
    press = side.crew.press
    side.crew.press = lambda agent, person, action: (
        acts.append(side.env.action_names[action]) or press(agent, person, action)
    )
    for button in ("N", "E", "stay", "W"):
        one.press(button)
    until(lambda: len(acts) == 4)
    del side.crew.press
    assert acts == ["north", "east", "stay", "west"]
    one.close()
    until(lambda: side.crew.seats[0].person is None)


def test_texts_and_pictures_are_made_once_for_all_browsers(page, browser, monkeypatch):
    browsers = [browser() for _ in range(3)]
    until(lambda: len(page._panels) == 3)
    made = []
    for module, name in (("words", "acts"), ("words", "numbers_table"), ("sight", "pictures")):
        real = getattr(__import__(f"warp_torchrl.live.{module}", fromlist=[name]), name)
        monkeypatch.setattr(
            f"warp_torchrl.live.{module}.{name}",
            lambda *a, real=real, name=name, **k: made.append(name) or real(*a, **k),
        )
    with page.lock:
        page.show()
    assert sorted(made) == ["acts", "numbers_table", "pictures"]
    shown = browsers[0].texts("step")
    until(lambda: all(each.texts("step") == shown for each in browsers))


def test_pictures_wait_while_the_match_plays(page, browser, monkeypatch):
    browser()
    painted = []
    panel = list(page._panels.values())[-1]
    monkeypatch.setattr(panel._tabs[0], "paint", lambda: painted.append(True))
    with page.lock:
        page.playing = True
        for _ in range(5):
            page.show()
        page.playing = False
        assert len(painted) <= 2, "a few times a second"
        page.show()
        page.show()
    assert len(painted) >= 2


def test_a_page_that_plays_faster_than_can_be_chosen_has_panels(page, browser, monkeypatch):
    monkeypatch.setattr(page, "pace", 500.0)
    assert browser().value("Steps a second") == 30


def test_what_the_page_itself_sets_and_who_is_not_there_ask_for_nothing(page, browser, monkeypatch, caplog):
    browser()
    panel, asked = list(page._panels.values())[-1], []
    with monkeypatch.context() as patch, page.lock:
        patch.setattr(page, "ask", lambda *given: asked.append(given))
        page.keeper.every = True
        panel.show()
        assert panel._tabs[4]._every.value
        panel._tabs[4]._every.value = page.keeper.every = False
        time.sleep(0.2)
    page.ask(12345, lambda: asked.append("an act"))
    page._welcome(SimpleNamespace(client_id=12345))
    assert is_well(page, browser) and asked == [] and caplog.records == []
