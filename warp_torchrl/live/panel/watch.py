"""The tab Watch: curves, a map, the acts of each vehicle, the legend."""

from typing import Any

import numpy as np
from viser import uplot

from warp_torchrl.env.pictures.render import painted
from warp_torchrl.env.pictures.veil import VIEWS, can_believe, seen_as
from warp_torchrl.live import words
from warp_torchrl.live.panel.picture import add_picture, png, show_picture
from warp_torchrl.live.panel.tab import Tab, chosen_option
from warp_torchrl.live.stage import change

_LINES = ("#f2a33a", "#6bb7ea", "#9a9a9a")
_MAP_SIDE = 360  # of the two-dimensional map [pixels]
Data = tuple[np.ndarray, ...]


class WatchTab(Tab):
    """What has become of the fire."""

    title = "Watch"

    def make(self) -> None:
        """Make the curves, the map and the table."""
        self._saved = self._curve("Saved [%]", uplot.Scale(auto=False, range=(0.0, 104.0)))
        self._burning = self._curve("Burning [%]", uplot.Scale(auto=True))
        self._view = self.gui.add_dropdown("Shown", VIEWS, initial_value=self.page.view)
        self._view.disabled = not can_believe(self.match.world)
        self._view.on_update(self.guarded(lambda _: self.page.set_view(chosen_option(self._view))))
        self._map = add_picture(self.gui, "Map")
        self._acts = self.gui.add_markdown("")
        self.gui.add_html(words.legend(self.side))

    def paint(self) -> None:
        """Show the match so far."""
        change(self._view, value=self.page.view)
        saved, burning, picture, acts = self.once("watch", self._shown)
        self._saved.data, self._burning.data = saved, burning
        show_picture(self._map, picture)
        change(self._acts, content=acts)

    def _shown(self) -> tuple[Data, Data, bytes, str]:
        """Return the curves, the map and the table."""
        sides = self.match.everywhere
        return (
            _curves([each.curves.saved for each in sides]),
            _curves([each.curves.burning for each in sides]),
            png(self._picture()),
            words.acts(self.side),
        )

    def _curve(self, name: str, scale: uplot.Scale) -> Any:
        names = [words.title(side) for side in self.match.everywhere]
        inks = [*_LINES[: len(names) - 1], _LINES[2]]
        lines = [uplot.Series(label=each, stroke=ink, width=2) for each, ink in zip(names, inks)]
        axis = uplot.Axis(stroke="#c9ced6", grid=uplot.Axis_Grid(stroke="rgba(140,150,165,.22)", width=1))
        return self.gui.add_uplot(
            (np.zeros(1), *(np.zeros(1) for _ in names)), (uplot.Series(label="step"), *lines), title=name,
            scales={"x": uplot.Scale(time=False), "y": scale}, axes=(axis, axis), height=170,
        )  # fmt: skip

    def _picture(self) -> np.ndarray:
        world = self.side.env.world
        state, colours = seen_as(self.side.state, world, self.page.view)
        scale = max(1, _MAP_SIDE // max(world.size))
        return painted(colours, state, world.team.table(self.side.env.device).flies, scale)[0].numpy()


def _curves(shares: list[list[float]]) -> Data:
    """Return the steps, and curves of shares as percentages, each as long as the longest."""
    count = max(map(len, shares))
    rows = (np.pad(np.array(curve) * 100.0, (0, count - len(curve)), mode="edge") for curve in shares)
    return (np.arange(count, dtype=np.float64), *rows)
