"""The page on a screen of 1280 x 800, in a browser that draws it."""

import shutil
import threading

import pytest

pytest.importorskip("viser", reason="needs the extra live")
pytest.importorskip("playwright", reason="playwright is not installed")

from playwright.sync_api import sync_playwright

from tests.live.conftest import SMALL
from warp_torchrl.live.address import Address
from warp_torchrl.live.match import Setting
from warp_torchrl.live.page import Page

CHROMIUM = shutil.which("chromium") or shutil.which("google-chrome")
FLAGS = ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
GAPS = """() => {
    const gaps = [];
    for (const row of document.querySelectorAll("table:not(.u-legend) tr")) {
        const cells = [...row.children].filter(cell => cell.innerText.trim() && cell.offsetParent);
        const boxes = cells.map(cell => {
            const range = document.createRange(), walker = document.createTreeWalker(cell, NodeFilter.SHOW_TEXT);
            const first = walker.nextNode();
            let last = first;
            while (walker.nextNode()) last = walker.currentNode;
            range.setStart(first, first.data.search(/\\S/));
            range.setEnd(last, last.data.trimEnd().length);
            return range.getBoundingClientRect();
        });
        for (let i = 1; i < cells.length; i++)
            gaps.push([cells[i - 1].innerText, cells[i].innerText, boxes[i].left - boxes[i - 1].right]);
    }
    return gaps;
}"""
"""Room between what two cells of a row say [pixels]."""
TABS = ("Watch", "Drive", "Agent", "World", "Record", "Match")


@pytest.fixture
def screen(tmp_path):
    """A page of viser's in a browser, after a step, and what went wrong in it."""
    if CHROMIUM is None:
        pytest.skip("there is no Chromium here")
    setting = Setting(policy="generalist", overrides=("scenario=default", *SMALL))
    with Page(setting, Address(port=0), tmp_path / "people") as page, sync_playwright() as driver:
        clock = threading.Thread(target=page.play)
        clock.start()
        browser = driver.chromium.launch(executable_path=CHROMIUM, args=[*FLAGS])
        shown = browser.new_page(viewport={"width": 1280, "height": 800})
        faults = []
        shown.on("pageerror", lambda error: faults.append(str(error)))
        shown.on("console", lambda line: faults.append(line.text) if line.type == "error" else None)
        shown.goto(f"http://127.0.0.1:{page.address.port}/?token={page.address.token}")
        shown.get_by_role("tab", name="Watch", exact=True).wait_for()
        yield shown, faults
        browser.close()
        page.stop()
        clock.join(timeout=10)


@pytest.mark.slow
def test_heads_do_not_run_together_nothing_is_cut_and_the_console_has_no_error(screen):
    shown, faults = screen
    for tab in TABS:
        shown.get_by_role("tab", name=tab, exact=True).click()
        shown.wait_for_timeout(500)
        gaps = shown.evaluate(GAPS)
        assert gaps and min(gap for _, _, gap in gaps) >= 6, (tab, min(gaps, key=lambda each: each[2]))
        assert shown.evaluate("document.documentElement.scrollWidth <= innerWidth"), tab
    assert not faults
