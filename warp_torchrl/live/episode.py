"""An episode as one HTML file: the scene, its pictures, and the program that shows them.

The file needs neither Python nor a network. It plays by itself in a loop; the bar below has pause, the time and the
speed, and the mouse turns the scene.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import torch
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.caption import progress
from warp_torchrl.env.pictures.colours import legend_colours
from warp_torchrl.env.pictures.veil import View, first_view, veil_colours
from warp_torchrl.live.crew import Crew
from warp_torchrl.live.scene import aim, furnish, local_server, map_offsets, quiet
from warp_torchrl.live.stage import Shown, Stage
from warp_torchrl.live.words import chips, labels, vehicle_colours
from warp_torchrl.system import disk
from warp_torchrl.system.foreign_text import escaped_markdown
from warp_torchrl.world.arrays.geometry import DIRECTIONS
from warp_torchrl.world.state.state import Cover, WorldState

STEP_SECONDS, END_SECONDS = 0.12, 2.0
"""How long a picture stands, and the last one."""
_STYLE = """<style>
#episode{position:fixed;left:0;top:0;z-index:1;pointer-events:none;padding:14px 18px;color:#f0f1f3;
font:15px/1.45 system-ui,sans-serif;text-shadow:0 0 4px #0d1321}
#episode h1{font-size:19px;font-weight:600;margin:0}#episode p{margin:0;color:#b9bdc4}
#episode footer{display:flex;flex-direction:column;font-size:13px;line-height:1.6;margin-top:8px}
</style>"""


class Film:
    """Sides of a match, recorded picture by picture.

    Args:
        sides: What is shown, side by side; all have one size.
        lines: Heading of the document, and what stands smaller below it.
    """

    def __init__(self, sides: Sequence[Shown], lines: Sequence[str]) -> None:
        self._sides, self._lines = sides, lines
        self.view: View = first_view(sides[0].env.world)
        """What the next pictures show."""
        size = sides[0].env.world.size
        self._server = local_server()
        furnish(self._server)
        aim(self._server, size, len(sides), aside=-0.04, up=0.02)  # heading and legend stand left
        self._stages = [
            Stage(self._server, index, side, east)
            for index, (side, east) in enumerate(zip(sides, map_offsets(size[1], len(sides))))
        ]
        self._film = self._server.get_scene_serializer()
        self._pictures = 0

    def add(self, titles: Sequence[str] | None = None) -> None:
        """Record the present state of the sides.

        Args:
            titles: Title of each side; by default its ``progress``.
        """
        if self._pictures:
            self._film.insert_sleep(STEP_SECONDS)
        for stage, title in zip(self._stages, titles or [progress(side.state, side.env.world) for side in self._sides]):
            stage.show(title, self.view)
        self._pictures += 1

    def document(self) -> str:
        """Return the film as an HTML document, and end it."""
        self._film.insert_sleep(END_SECONDS)
        page = self._film.as_html(dark_mode=True)
        with quiet():
            self._server.stop()
        veil = {} if self.view == "truth" else veil_colours()
        return _framed(page, self._lines, {**map_colours(self._sides[0]), **veil})


def map_colours(side: Shown) -> dict[str, Sequence[int]]:
    """Return the colours of what can be seen on a side's map, by name: covers, fire, what is left, houses, vehicles."""
    absent = {cover.name.lower() for cover in Cover} - {
        Cover(each).name.lower() for each in side.state.cover.unique().tolist()
    }
    drawn = legend_colours(side.env.world.buildings(side.state) is not None)
    colours: Mapping[str, Sequence[int]] = {name: colour for name, colour in drawn.items() if name not in absent}
    names = side.env.agent_names
    vehicles = zip(labels(names), vehicle_colours(names).items())
    return {**colours, **{f"{short}  {name}": colour for short, (name, colour) in vehicles}}


def _framed(page: str, lines: Sequence[str], colours: Mapping[str, Sequence[int]]) -> str:
    """Return viser's document with a title, a heading and a legend; the scene's own texts are data, not HTML."""
    heading, *below = map(escaped_markdown, lines)
    top = f"<h1>{heading}</h1>" + "".join(f"<p>{line}</p>" for line in below)
    page = page.replace("<title>Viser</title>", f"<title>{' - '.join((heading, *below))}</title>", 1)
    before, end, after = page.rpartition("</body>")
    return f"{before}{_STYLE}<div id='episode'>{top}<footer>{chips(colours)}</footer></div>{end}{after}"


@dataclass
class _Watched:
    """A team whose vehicles are all moved by its policy."""

    env: WildfireEnv
    crew: Crew
    state: WorldState
    facing: Tensor = field(init=False)

    def __post_init__(self) -> None:
        self.facing = torch.full((self.env.n_agents,), -1)

    def go_on(self, state: WorldState) -> None:
        """Show the next state; vehicles face where they last moved."""
        there, action = state.vehicles.position[0], state.vehicles.last_action[0]
        moved = (there != self.state.vehicles.position[0]).any(dim=1) & (action < len(DIRECTIONS))
        self.facing, self.state = torch.where(moved, action.long(), self.facing), state


class SceneRecorder:
    """Collects an episode state by state, as ``EpisodeRecorder`` does, and writes it as an HTML document.

    Args:
        title: Heading of the document; what follows a line break stands smaller below it.
        env: Whose episode it is.
    """

    def __init__(self, title: str, env: WildfireEnv) -> None:
        self._lines, self._env = title.splitlines(), env
        self._film: Film | None = None

    def add(self, state: WorldState) -> None:
        """Append world 0 of a batch."""
        state = state[:1].to("cpu")
        if self._film is None:
            self._side = _Watched(self._env, Crew(self._env.world.team), state)
            self._film = Film([self._side], self._lines)
        self._side.go_on(state)
        self._film.add()

    def save(self, path: Path) -> None:
        """Write the document; the file appears whole or not at all.

        Raises:
            ValueError: If no state was added.
        """
        if self._film is None:
            raise ValueError("an episode needs at least one state, got none")
        disk.replace(path, self._film.document())
