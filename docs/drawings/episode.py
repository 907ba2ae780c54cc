"""A team at work in three dimensions, photographed in a browser: the file of ``live.episode``, played and looked at."""

import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image

from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.words import title
from warp_torchrl.system import disk

_WIDTH, _HEIGHT = 900, 620
_FLAGS = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")  # a picture without a GPU too
_PLAIN = ".mantine-Notifications-root{display:none}"  # what the browser has to say of its graphics
_FRAME_MS, _LAST_FRAME_MS = 140, 2000


def photograph(setting: Setting, first: int, last: int, every: int, path: Path, sharpness: float) -> Path:
    """Write pictures of a match: of one step as PNG, of several as an animated WebP.

    Args:
        setting: What is played.
        first: Step of the first picture.
        last: Step of the last one; where the episode is over before, its end is the last.
        every: Steps from one picture to the next.
        path: The file, without its ending.
        sharpness: Pixels of the picture for one of the page of 900 x 620, in 0.2..4.

    Returns:
        The file.

    Raises:
        ValueError: If Playwright, viser or a browser is not installed, or the sharpness is out of its range.
        ConfigError: If the setting does not fit.
    """
    check_installed()
    if not 0.2 <= sharpness <= 4.0:
        raise ValueError(f"sharpness must be in 0.2..4, got {sharpness}")
    document, seconds = _film(setting, first, last, every)
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "episode.html"
        page.write_text(document)
        pictures = _pictures(page, seconds, sharpness)
    path.parent.mkdir(parents=True, exist_ok=True)
    if len(pictures) == 1:
        path = path.with_suffix(".png")
        with disk.drafted(path) as draft:
            pictures[0].save(draft, optimize=True)
        return path
    path = path.with_suffix(".webp")
    times = [_FRAME_MS] * (len(pictures) - 1) + [_LAST_FRAME_MS]
    with disk.drafted(path) as draft:
        pictures[0].save(draft, save_all=True, append_images=pictures[1:], duration=times, loop=0, quality=75, method=6)
    return path


def check_installed() -> None:
    """Check that there is what plays an episode and photographs it.

    Raises:
        ValueError: If there is not.
    """
    if find_spec("viser") is None:
        raise ValueError('an episode needs viser: pip install "warp_torchrl[live]"')
    if find_spec("playwright") is None:
        raise ValueError("an episode is photographed with Playwright: pip install playwright, and have Chromium")


def _film(setting: Setting, first: int, last: int, every: int) -> tuple[str, list[float]]:
    """Return the document of a match, and when each picture stands in it [s]."""
    from warp_torchrl.live.episode import STEP_SECONDS, Film  # the extra live

    match = Match(setting)
    for _ in range(first):
        match.step()
    below = f"policy {' and '.join(title(side) for side in match.sides)}, seed {setting.seed}"
    film, count = Film(match.sides, [" ".join((match.scenario, *setting.overrides)), below]), 1
    film.add()
    for step in range(first, last):
        if all(side.ended for side in match.sides):
            break
        match.step()
        if (step + 1 - first) % every == 0:
            film.add()
            count += 1
    return film.document(), [(index + 0.5) * STEP_SECONDS for index in range(count)]


def _pictures(page: Path, seconds: Sequence[float], sharpness: float) -> list[Image.Image]:
    with _browser() as browser:
        tab = browser.new_page(viewport={"width": _WIDTH, "height": _HEIGHT}, device_scale_factor=sharpness)
        tab.goto(page.as_uri())
        clock = tab.locator("input").first
        clock.wait_for(timeout=120_000)
        tab.add_style_tag(content=_PLAIN)
        tab.wait_for_timeout(5000)  # until shapes and letters are there
        return [_picture(tab, clock, each) for each in seconds]


def _picture(tab: Any, clock: Any, second: float) -> Image.Image:
    for _ in range(20):  # what is typed while it plays may be lost
        clock.fill(f"{second:.2f}")
        clock.evaluate("clock => clock.blur()")
        for _ in range(6):
            tab.evaluate("() => new Promise(done => requestAnimationFrame(done))")
        if abs(float(clock.input_value()) - second) < 0.06:
            break
    shot = tab.screenshot(clip=tab.locator("canvas").first.bounding_box())
    return Image.open(BytesIO(shot)).convert("RGB")


@contextmanager
def _browser() -> Iterator[Any]:
    """Yield a Chromium: that of the system, else Playwright's own.

    Raises:
        ValueError: If there is none.
    """
    from playwright.sync_api import Error, sync_playwright

    found = next((path for name in ("chromium", "google-chrome") if (path := shutil.which(name))), None)
    with sync_playwright() as driver:
        try:
            browser = driver.chromium.launch(executable_path=found, args=["--headless=new", "--no-sandbox", *_FLAGS])
        except Error as error:
            raise ValueError(f"Chromium does not start: {error.message.splitlines()[0]}") from None
        yield browser
        browser.close()
