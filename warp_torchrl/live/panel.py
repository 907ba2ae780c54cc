"""One person's controls on the page; each browser has its own."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import viser
from viser import uplot

from warp_torchrl.config.compose import conf_folder
from warp_torchrl.env.render import render
from warp_torchrl.heuristics import HEURISTICS
from warp_torchrl.live import sight, words
from warp_torchrl.live.crew import Question
from warp_torchrl.live.drawing import cell_at
from warp_torchrl.live.match import Match, Setting
from warp_torchrl.live.order import Order
from warp_torchrl.live.side import Side
from warp_torchrl.live.stage import Stage, change
from warp_torchrl.runs.shipped import policy_names

if TYPE_CHECKING:
    from warp_torchrl.live.page import Page

KEYS = {
    "Q": "north_west", "W": "north", "E": "north_east", "A": "west", "S": "stay", "D": "east", "Z": "south_west",
    "X": "south", "C": "south_east", "F": "extinguish", "R": "clear",
}  # fmt: skip
"""Keys that drive a vehicle, by the names of their actions; they lie on the keyboard as the moves do on the map."""
_PADS = (("NW", "N", "NE"), ("W", "stay", "E"), ("SW", "S", "SE"))
_MOVES = {
    "NW": "north_west", "N": "north", "NE": "north_east", "W": "west", "stay": "stay", "E": "east",
    "SW": "south_west", "S": "south", "SE": "south_east",
}  # fmt: skip
_LOOK, _LIGHT, _CUT, _SEND = "nothing", "lights it", "cuts a firebreak", "sends the vehicle there"
_NEED_A_FOLDER = ("landfire", "wildland")
_ALONE = "nobody"
_LINES = ("#f2a33a", "#6bb7ea", "#9a9a9a")
_PAINTED_EVERY = 0.25  # seconds between two pictures of what takes long to make, while the match plays
_MAP_SIDE = 360  # of the two-dimensional map [pixels]


class Panel:
    """The controls of one browser, and what they show.

    Args:
        page: What they control; its lock is held when they are made or shown.
        client: The browser.
    """

    def __init__(self, page: "Page", client: viser.ClientHandle) -> None:
        self._page, self._client, self._gui = page, client, client.gui
        self._own: list[Any] = []
        self._painted = 0.0
        self._add_keys()
        self.fill()

    @property
    def _match(self) -> Match:
        return self._page.match

    @property
    def _side(self) -> Side:
        return self._match.sides[0]

    @property
    def _agent(self) -> int:
        return self._side.env.agent_names.index(self._vehicle.value)

    # What is made

    def fill(self) -> None:
        """Make the controls of the present match."""
        for handle in self._own:
            handle.remove()
        self._asked: list[Question] = []
        self._own = [self._add_play(), self._add_question(), tabs := self._gui.add_tab_group()]
        with tabs.add_tab("Watch"):
            self._add_watch()
        with tabs.add_tab("Drive"):
            self._add_drive()
        with tabs.add_tab("Agent"):
            self._add_agent()
        with tabs.add_tab("World"):
            self._add_world()
        with tabs.add_tab("Match"):
            self._add_match()

    def _add_play(self) -> Any:
        gui, folder = self._gui, self._gui.add_folder("Play")
        with folder:
            self._headline = gui.add_markdown("")
            play = gui.add_button_group("", ("Play", "Pause", "Step", "Restart"))
            pace = gui.add_slider("Steps a second", min=1, max=30, step=1, initial_value=round(self._page.pace))
            self._numbers = gui.add_markdown("")
        play.on_click(self._guarded(lambda event: self._play(event.target.value)))
        pace.on_update(self._guarded(lambda event: setattr(self._page, "pace", float(event.target.value))))
        return folder

    def _add_question(self) -> Any:
        self._question = self._gui.add_folder("The match waits for your word", visible=False)
        with self._question:
            self._asking = self._gui.add_markdown("")
            word = self._gui.add_button_group("", ("Do it", "Don't"))
        word.on_click(self._guarded(lambda event: self._answer(event.target.value == "Do it")))
        return self._question

    def _add_watch(self) -> None:
        gui = self._gui
        self._saved = self._curve("Saved [%]", uplot.Scale(auto=False, range=(0.0, 104.0)))
        self._burning = self._curve("Burning [%]", uplot.Scale(auto=True))
        self._map = gui.add_image(self._picture(), label="Map", format="png")
        self._acts = gui.add_markdown("")
        gui.add_html(words.legend(self._side))

    def _curve(self, name: str, scale: uplot.Scale) -> Any:
        names = [words.title(side) for side in self._match.everywhere]
        inks = [*_LINES[: len(names) - 1], _LINES[2]]
        lines = [uplot.Series(label=each, stroke=ink, width=2) for each, ink in zip(names, inks)]
        axis = uplot.Axis(stroke="#c9ced6", grid=uplot.Axis_Grid(stroke="rgba(140,150,165,.22)", width=1))
        return self._gui.add_uplot(
            (np.zeros(1), *(np.zeros(1) for _ in names)), (uplot.Series(label="step"), *lines), title=name,
            scales={"x": uplot.Scale(time=False), "y": scale}, axes=(axis, axis), height=170,
        )  # fmt: skip

    def _add_drive(self) -> None:
        gui, names = self._gui, self._side.env.agent_names
        self._vehicle = gui.add_dropdown("Vehicle", tuple(names), initial_value=names[0])
        self._mover = gui.add_markdown("")
        take = gui.add_button_group("", ("Take over", "Hand back"))
        take.on_click(self._guarded(lambda event: self._seat(event.target.value == "Take over")))
        for row in _PADS:
            pad = gui.add_button_group("", row)
            pad.on_click(self._guarded(lambda event: self._press(_MOVES[event.target.value], event)))
        acts = tuple(name for name in self._side.env.action_names if name not in _MOVES.values())
        deeds = gui.add_button_group("", acts)
        deeds.on_click(self._guarded(lambda event: self._press(event.target.value, event)))
        gui.add_markdown("Keys: **Q W E A D Z X C** move, **S** stays, **F** extinguishes, **R** clears, **P** plays.")
        with gui.add_folder("Send it"):
            self._radius = gui.add_slider("Within cells", min=0, max=16, step=1, initial_value=3)
            self._goal = gui.add_vector2("Row, column", initial_value=self._middle(), min=(0, 0), step=1)
            send = gui.add_button_group("", ("Send", "Set free"))
            send.on_click(self._guarded(lambda event: self._send(event.target.value == "Send")))
        with gui.add_folder("Ask me before the policy"):
            for name in acts:
                box = gui.add_checkbox(name, initial_value=name in self._side.crew.asks)
                box.on_update(self._guarded(partial(self._ask, name)))
        self._vehicle.on_update(self._guarded(lambda event: self.show()))

    def _add_agent(self) -> None:
        gui = self._gui
        self._who = gui.add_markdown("")
        self._chances = gui.add_html("")
        self._sights = {
            name: gui.add_image(picture, label=name or "observation", format="png")
            for name, picture in sight.pictures(self._side, 0).items()
        }
        self._told = gui.add_html("")

    def _add_world(self) -> None:
        gui = self._gui
        self._click = gui.add_dropdown("A click on a cell", (_LOOK, _LIGHT, _CUT, _SEND), initial_value=_LOOK)
        self._cell = gui.add_vector2("Row, column", initial_value=self._middle(), min=(0, 0), step=1)
        there = gui.add_button_group("", ("Light it", "Cut a firebreak"))
        there.on_click(self._guarded(lambda event: self._act_on(self._cell.value, event.target.value == "Light it")))
        with gui.add_folder("Wind"):
            self._speed = gui.add_slider("m/s", min=0.0, max=30.0, step=0.5, initial_value=4.0)
            self._direction = gui.add_slider("Goes to, degrees", min=0, max=345, step=15, initial_value=0)
            hold = gui.add_button("Hold this wind", hint="until the next start, on all sides")
            gui.add_markdown("0 is east, 90 is north. The scenario's own wind blows again from the next start on.")
        hold.on_click(self._guarded(lambda event: self._blow()))

    def _add_match(self) -> None:
        gui, setting, given = self._gui, self._match.setting, self._page.given
        policies = tuple(dict.fromkeys((*self._named(given), *policy_names(), *HEURISTICS)))
        self._scenario = gui.add_dropdown("Scenario", self._scenarios(), initial_value=self._scenario_of(setting))
        self._policy = gui.add_dropdown("Policy", policies, initial_value=setting.policy)
        self._beside = gui.add_dropdown("Beside it", (_ALONE, *policies), initial_value=setting.beside or _ALONE)
        self._seed = gui.add_number("Seed", initial_value=setting.seed, min=0, step=1)
        load = gui.add_button("Load", hint="shows this match from its start")
        load.on_click(self._guarded(lambda event: self._load()))

    def _add_keys(self) -> None:
        for key, action in KEYS.items():
            command = self._gui.add_command(f"Drive: {action}", hotkey=key)
            command.on_trigger(self._guarded(partial(self._press, action)))
        play = self._gui.add_command("Play or pause", hotkey="P")
        play.on_trigger(self._guarded(lambda event: self._play("Pause" if self._page.playing else "Play")))

    # What is shown

    def show(self) -> None:
        """Show the match as it is; while it plays pictures and curves follow a few times a second."""
        with self._client.atomic():
            change(self._headline, content=words.headline(self._match))
            change(self._numbers, content=words.numbers(self._match))
            self._show_question()
            if not self._page.playing or time.monotonic() - self._painted > _PAINTED_EVERY:
                self._paint()

    def _paint(self) -> None:
        """Show what takes long to make and to send."""
        match, side, agent = self._match, self._side, self._agent
        self._painted = time.monotonic()
        self._plot(self._saved, [each.curves.saved for each in match.everywhere])
        self._plot(self._burning, [each.curves.burning for each in match.everywhere])
        change(self._map, image=self._picture())
        change(self._acts, content=words.acts(side))
        mover = words.moved_by(side, agent, self._client.client_id)
        change(self._mover, content=f"Moved by: **{mover}**")
        change(self._who, content=f"What **{side.env.agent_names[agent]}** sees, and how likely it acts:")
        change(self._chances, content=words.actions(side, agent))
        change(self._told, content=words.told(sight.numbers(side, agent)))
        pictures = sight.pictures(side, agent)
        for name, handle in self._sights.items():
            change(handle, image=pictures[name])

    def tell(self, line: str, mistake: bool = False) -> None:
        """Tell the person something."""
        self._client.add_notification(
            "This cannot be done" if mistake else "Told", line, auto_close_seconds=7.0, color="red" if mistake else None
        )

    def _plot(self, handle: Any, curves: list[list[float]]) -> None:
        count = max(len(curve) for curve in curves)
        rows = [np.pad(np.array(curve) * 100.0, (0, count - len(curve)), mode="edge") for curve in curves]
        handle.data = (np.arange(count, dtype=np.float64), *rows)

    def _show_question(self) -> None:
        self._asked = self._match.questions()  # the policy proposes: its probabilities are of what it sees now
        names, actions = self._side.env.agent_names, self._side.env.action_names
        lines = [f"**{names[each.agent]}** is about to **{actions[each.action]}**." for each in self._asked]
        change(self._asking, content="\n\n".join(lines))
        change(self._question, visible=bool(lines))

    def _picture(self) -> np.ndarray:
        state, team = self._side.state, self._side.env.world.team
        scale = max(1, _MAP_SIDE // max(self._match.world.size))
        return render(state, team.table(self._side.env.device).flies, scale)[0].numpy()

    # What is done; each under the lock, and told in one line where it cannot be

    def click(self, stage: Stage, origin: tuple[float, float, float], direction: tuple[float, float, float]) -> None:
        """Do what a click on a cell is to do; the page's lock is held."""
        with self._told_if_refused():
            x, y, z = origin
            cell = cell_at((x - stage.east, y, z), direction, stage.ground)
            if cell is None or self._click.value == _LOOK:
                return
            if self._click.value == _SEND:
                self._goal.value = cell
                self._send(True)
                return
            self._cell.value = cell
            self._act_on(cell, self._click.value == _LIGHT)

    @contextmanager
    def _told_if_refused(self) -> Iterator[None]:
        try:
            yield
        except (ValueError, OSError) as error:
            self.tell(" ".join(str(error).split()), mistake=True)
        except Exception as error:  # a page must not fall silent; the match goes on as it was
            self.tell(f"{type(error).__name__}: {' '.join(str(error).split())}", mistake=True)

    def _guarded(self, do: Callable[[Any], object]) -> Callable[[Any], None]:
        """Return a callback that does something under the page's lock, and tells what is refused."""

        def call(event: Any) -> None:
            with self._page.lock, self._told_if_refused():
                do(event)

        return call

    def _play(self, button: str) -> None:
        page = self._page
        if button == "Restart":
            page.restart()
            return
        page.playing = button == "Play" and not self._match.ended
        (page.step if button == "Step" else page.show)()

    def _seat(self, take: bool) -> None:
        crew, person = self._side.crew, self._client.client_id
        (crew.take if take else crew.hand_back)(self._agent, person)
        self._page.show()

    def _press(self, action: str, event: Any) -> None:
        """Do an act with the chosen vehicle; where the clock stands still the act is a step."""
        names = self._side.env.action_names
        if action not in names:
            raise ValueError(f"this team has no action {action}")
        self._side.crew.press(self._agent, self._client.client_id, names.index(action))
        if not self._page.playing:
            self._page.step()

    def _send(self, go: bool) -> None:
        row, column = (int(each) for each in self._goal.value)
        self._match.check_cell(row, column)
        order = Order(row=row, column=column, radius=int(self._radius.value)) if go else None
        self._side.order(self._agent, order)
        self._page.show()

    def _ask(self, name: str, event: Any) -> None:
        crew = self._side.crew
        crew.ask_before(crew.asks | {name} if event.target.value else crew.asks - {name})
        self._page.show()

    def _answer(self, allow: bool) -> None:
        for question in self._asked:
            self._side.crew.answer(question, allow)
        if not self._page.playing:
            self._page.step()
        self._page.show()

    def _act_on(self, cell: tuple[float, float], light: bool) -> None:
        row, column = (int(each) for each in cell)
        (self._match.ignite if light else self._match.clear)(row, column)
        self._page.show()

    def _blow(self) -> None:
        self._match.blow(float(self._speed.value), float(self._direction.value))
        self._page.show()

    def _load(self) -> None:
        scenario, policy, beside = (_chosen(each) for each in (self._scenario, self._policy, self._beside))
        is_given = scenario == self._scenario_of(self._page.given)
        setting = Setting(
            policy=policy,
            beside=None if beside == _ALONE else beside,
            seed=int(self._seed.value),
            overrides=self._page.given.overrides if is_given else (f"scenario={scenario}",),
        )
        self._page.open(Match(setting))

    # What there is to choose

    def _middle(self) -> tuple[int, int]:
        rows, columns = self._match.world.size
        return rows // 2, columns // 2

    @staticmethod
    def _named(setting: Setting) -> list[str]:
        return [name for name in (setting.policy, setting.beside) if name is not None]

    def _scenarios(self) -> tuple[str, ...]:
        """Return what can be chosen: what the page was started with, and the scenarios that read no file."""
        ready = sorted(path.stem for path in (conf_folder() / "scenario").glob("*.yaml"))
        return (self._scenario_of(self._page.given), *(name for name in ready if name not in _NEED_A_FOLDER))

    def _scenario_of(self, setting: Setting) -> str:
        """Return what a setting's scenario is called among ``_scenarios``."""
        if setting.overrides == self._page.given.overrides:
            return " ".join(("as started:", *setting.overrides)) if setting.overrides else "the policy's own"
        return self._match.scenario


def _chosen(dropdown: Any) -> str:
    """Return what is chosen, which a browser may not make up: it could name a file of this machine.

    Raises:
        ValueError: If it is none of the options.
    """
    if dropdown.value not in dropdown.options:
        raise ValueError(f"{dropdown.label} must be one of {', '.join(dropdown.options)}, got {dropdown.value}")
    return str(dropdown.value)
