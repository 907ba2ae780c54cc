"""The tab Drive: the vehicle and its driver, orders, and the policy's questions."""

from functools import partial

from warp_torchrl.live import words
from warp_torchrl.live.order import Order
from warp_torchrl.live.panel.tab import Tab
from warp_torchrl.live.stage import change

DRIVE_KEYS = {
    "Q": "north_west", "W": "north", "E": "north_east", "A": "west", "S": "stay", "D": "east", "Z": "south_west",
    "X": "south", "C": "south_east", "F": "extinguish", "R": "clear",
}  # fmt: skip
"""Keys that drive a vehicle, by the names of their actions; they lie on the keyboard as the moves do on the map."""
_PADS = (("NW", "N", "NE"), ("W", "stay", "E"), ("SW", "S", "SE"))
_MOVES = {
    "NW": "north_west", "N": "north", "NE": "north_east", "W": "west", "stay": "stay", "E": "east",
    "SW": "south_west", "S": "south", "SE": "south_east",
}  # fmt: skip


class DriveTab(Tab):
    """How a person takes part."""

    title = "Drive"

    def make(self) -> None:
        """Make the choice of the vehicle, and the buttons."""
        gui, names = self.gui, self.side.env.agent_names
        self._vehicle = gui.add_dropdown("Vehicle", tuple(names), initial_value=names[0])
        self._mover = gui.add_markdown("")
        take = gui.add_button_group("", ("Take over", "Hand back"))
        take.on_click(self.guarded(lambda value: self._seat(value == "Take over")))
        for row in _PADS:
            pad = gui.add_button_group("", row)
            pad.on_click(self.guarded(lambda value: self.press(_MOVES[value])))
        acts = tuple(name for name in self.side.env.action_names if name not in _MOVES.values())
        deeds = gui.add_button_group("", acts)
        deeds.on_click(self.guarded(self.press))
        gui.add_markdown(
            "Keys: **Q W E A D Z X C** move, **S** stays, **F** extinguishes, **R** clears, **G** says *Do it*, **P** "
            "plays."
        )
        with gui.add_folder("Send it"):
            self._radius = gui.add_slider("Within cells", min=0, max=16, step=1, initial_value=3)
            self._goal = gui.add_vector2(
                "Row, column", initial_value=self.middle(), min=(0, 0), max=self.last(), step=1
            )
            send = gui.add_button_group("", ("Send", "Set free"))
            send.on_click(self.guarded(lambda value: self._send(value == "Send")))
        with gui.add_folder("Ask me before the policy"):
            for name in acts:
                box = gui.add_checkbox(name, initial_value=name in self.side.crew.asks)
                box.on_update(self.guarded(partial(self._ask, name)))
        with gui.add_folder("Ask me where the policy is less sure than"):
            below = self.side.crew.unsure_below
            self._below = gui.add_slider(
                "Likeliest action [%]", min=5, max=100, step=5, initial_value=round(100 * (below or 0.5))
            )
            self._unsure = gui.add_checkbox("Ask me for the action", initial_value=below is not None)
            for control in (self._below, self._unsure):
                control.on_update(self.guarded(lambda _: self._ask_where_unsure()))
        self._vehicle.on_update(self.guarded(lambda _: self.panel.show()))

    def paint(self) -> None:
        """Show whether the policy or a person moves the chosen vehicle."""
        mover = words.moved_by(self.side, self.agent, self.panel.person)
        change(self._mover, content=f"Moved by: **{mover}**")

    @property
    def agent(self) -> int:
        """Return the index of the chosen vehicle."""
        return self.side.env.agent_names.index(self._vehicle.value)

    def press(self, action: str) -> None:
        """Do an action with the vehicle of the open question, else with the chosen one.

        Where the clock stands still an act is a step.

        Raises:
            ValueError: If the team has no such action, or it cannot be done.
        """
        names = self.side.env.action_names
        if action not in names:
            raise ValueError(f"this team has no action {action}")
        if self.panel.question.choose(names.index(action)):
            return
        self.side.crew.press(self.agent, self.panel.person, names.index(action))
        if not self.page.playing:
            self.page.step()

    def send_to(self, cell: tuple[int, int]) -> None:
        """Send the chosen vehicle to a cell."""
        self._goal.value = cell
        self._send(True)

    def _seat(self, take: bool) -> None:
        crew = self.side.crew
        (crew.take if take else crew.hand_back)(self.agent, self.panel.person)
        self.page.show()

    def _send(self, go: bool) -> None:
        row, column = (int(each) for each in self._goal.value)
        self.match.check_cell(row, column)
        order = Order(row=row, column=column, radius=int(self._radius.value)) if go else None
        self.side.order(self.agent, order)
        self.page.show()

    def _ask(self, name: str, wanted: bool) -> None:
        crew = self.side.crew
        crew.ask_before(crew.asks | {name} if wanted else crew.asks - {name})
        self.page.show()

    def _ask_where_unsure(self) -> None:
        try:
            self.side.ask_where_unsure(self._below.value / 100.0 if self._unsure.value else None)
        except ValueError:
            self._unsure.value = self.side.crew.unsure_below is not None
            raise
        self.page.show()
