"""A team that believes: the fire, what its team believes of it, and its newest records, side by side."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor

from warp_torchrl.api.make import make_env
from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.drawing import sheet
from warp_torchrl.env.pictures.render import painted
from warp_torchrl.env.pictures.veil import BELIEVED, FOG, HIDDEN, seen_as
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.runs.config.seeds import FIRST_EVALUATED
from warp_torchrl.system import disk
from warp_torchrl.world.state.cells import count_trees, is_burning
from warp_torchrl.world.state.records import KNOWLEDGE
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.team.knowledge import Belief

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PANELS = ("The fire", "What the team believes", "Its newest records")
_SEED = FIRST_EVALUATED + 7
"""An evaluation fire whose two fires burn apart."""
_PAPER, _INK, _SOFT = (24, 27, 32), (240, 241, 243), (168, 170, 174)
_MARGIN, _HEAD, _FOOT = 10, 44, 30  # [pixels]
_FRAME_MS, _LAST_FRAME_MS = 140, 2500


def belief(times: Sequence[int] = (8, 16, 72), seed: int = _SEED, overrides: Sequence[str] = ()) -> "Figure":
    """A fire of ``scouts``, what its team believes of it, and its newest records, at three times."""
    names = [[f"{name} {time}" for name in PANELS] for time in times]
    figure, axes = sheet(names, (7.2, 2.45 * len(times) + 0.5), "A fire of scenario scouts, and what its team knows")
    env = _team(seed, overrides)
    for step, state in enumerate(_played(env, max(times))):
        if step not in times:
            continue
        for name, image in zip(PANELS, _maps(state, env, 6), strict=True):
            own = axes[f"{name} {step}"]
            own.imshow(image, interpolation="nearest")
            own.set(xticks=[], yticks=[], title=name if step == min(times) else "")
            own.set_xlabel(f"Jaccard {_right(state, env, name):.2f}" if name != PANELS[0] else "")
        axes[f"{PANELS[0]} {step}"].set_ylabel(f"step {step}")
    for own in axes.values():
        own.axison = bool(own.images)  # the fire may be out before
    _legend(figure)
    return figure


def scouts(path: Path, seed: int = _SEED, overrides: Sequence[str] = ()) -> None:
    """The same as an animation of the whole episode, a picture for each step."""
    env = _team(seed, overrides)
    frames = [_frame(state, env) for state in _played(env, env.world.horizon)]
    times = [_FRAME_MS] * (len(frames) - 1) + [_LAST_FRAME_MS]
    with disk.drafted(path) as draft:
        frames[0].save(draft, "WEBP", save_all=True, append_images=frames[1:], duration=times, loop=0, lossless=True)


def _team(seed: int, overrides: Sequence[str]) -> WildfireEnv:
    return make_env("scouts", n_worlds=1, seed=seed, overrides=["belief=ensemble", *overrides])


def _played(env: WildfireEnv, steps: int) -> Iterator[WorldState]:
    """Yield the worlds at the start and after each of so many steps of ``dispatch``, until the episode ends."""
    policy, now = HEURISTICS["dispatch"](env), env.reset()
    yield env.world_state
    for _ in range(steps):
        now = env.step(policy(now))["next"]
        yield env.world_state
        if bool(now["done"].all()):
            return


def _maps(state: WorldState, env: WildfireEnv, scale: int) -> list[np.ndarray]:
    """Return the maps of ``PANELS``, uint8 [h, w, 3] each, all with the vehicles."""
    flies = env.world.team.table(state.cells.device).flies
    seen = (
        seen_as(state.without_planes(KNOWLEDGE), env.world, "truth"),
        seen_as(state, env.world, "belief"),
        seen_as(state, replace(env.world, belief=Belief()), "belief"),
    )
    return [painted(colours, shown, flies, scale)[0].numpy() for shown, colours in seen]


def _right(state: WorldState, env: WildfireEnv, name: str) -> float:
    """Return the Jaccard index of the burning cells with those that are thought to burn, in 0..1."""
    world = env.world if name == PANELS[1] else replace(env.world, belief=Belief())
    known: Tensor = world.believed_fire(state)[0].mean(dim=1) > 0.5
    burns = is_burning(state.cells)
    return float((known & burns).sum() / (known | burns).sum().clamp(min=1))


def _legend(figure: "Figure") -> None:
    """Write below a figure the meaning of the colours of its veil."""
    from matplotlib.legend_handler import HandlerTuple
    from matplotlib.patches import Patch

    def strip(*colours: Sequence[float]) -> tuple[Patch, ...]:
        return tuple(Patch(facecolor=np.divide(each, 255.0), edgecolor="none") for each in colours)

    entries = {
        "thought to burn: unlikely to sure": strip(*BELIEVED),
        "may hide a fire": strip(HIDDEN),
        "never seen, or long ago": strip(FOG),
    }
    figure.legend(
        list(entries.values()), list(entries), loc="outside lower center", ncols=3,
        handler_map={tuple: HandlerTuple(ndivide=None, pad=0.0)}, handlelength=3.0,
    )  # fmt: skip


def _frame(state: WorldState, env: WildfireEnv) -> Image.Image:
    """Return a picture of the animation, RGB."""
    maps = _maps(state, env, max(1, 256 // max(env.world.size)))
    (height, width), count = maps[0].shape[:2], len(maps)
    size = (count * width + (count + 1) * _MARGIN, height + _HEAD + _FOOT + _MARGIN)
    canvas = Image.new("RGB", size, _PAPER)
    draw, large, small = ImageDraw.Draw(canvas), ImageFont.load_default(16), ImageFont.load_default(13)
    for at, (name, picture) in enumerate(zip(PANELS, maps, strict=True)):
        left = _MARGIN + at * (width + _MARGIN)
        canvas.paste(Image.fromarray(picture), (left, _HEAD))
        draw.text((left, 15), name, _INK, large, anchor="lm")
        saved = float(count_trees(state).saved()[0])
        below = f"step {int(state.step)}: {saved:.0%} saved" if at == 0 else f"Jaccard {_right(state, env, name):.2f}"
        draw.text((left, 33), below, _SOFT, small, anchor="lm")
    x, y = _MARGIN, size[1] - _FOOT // 2 - 3
    for colours, text in (
        (_ramp(), "thought to burn: unlikely to sure"),
        (np.array([HIDDEN]), "may hide a fire"),
        (np.array([FOG]), "never seen, or long ago"),
    ):
        chip = Image.fromarray(colours[None].astype(np.uint8))
        chip = chip.resize((10 + 3 * len(colours), 13), Image.Resampling.NEAREST)
        canvas.paste(chip, (x, y - 6))
        draw.text((x + chip.width + 7, y), text, _INK, small, anchor="lm")
        x += chip.width + 7 + int(small.getlength(text)) + 22
    return canvas


def _ramp() -> np.ndarray:
    """Return the colours of chances from 0 to 1, [16, 3]."""
    at = np.linspace(0.0, len(BELIEVED) - 1, 16)
    return np.stack([np.interp(at, range(len(BELIEVED)), channel) for channel in np.transpose(BELIEVED)], axis=1)
