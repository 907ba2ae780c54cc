"""The tab World: what a click on a cell does, and the wind."""

from warp_torchrl.live.panel.tab import Tab

_LOOK, _LIGHT, _CUT, _SEND = "nothing", "lights it", "cuts a firebreak", "sends the vehicle there"


class WorldTab(Tab):
    """How people change the world, on all sides of the match."""

    title = "World"

    def make(self) -> None:
        """Make the choice of what a click does, and the wind."""
        gui = self.gui
        self._click = gui.add_dropdown("A click on a cell", (_LOOK, _LIGHT, _CUT, _SEND), initial_value=_LOOK)
        self.cell = gui.add_vector2("Row, column", initial_value=self.middle(), min=(0, 0), max=self.last(), step=1)
        there = gui.add_button_group("", ("Light it", "Cut a firebreak"))
        there.on_click(self.guarded(lambda value: self._act_on(self.cell.value, value == "Light it")))
        with gui.add_folder("Wind"):
            self._speed = gui.add_slider("m/s", min=0.0, max=30.0, step=0.5, initial_value=4.0)
            self._direction = gui.add_slider("Goes to, degrees", min=0, max=345, step=15, initial_value=0)
            hold = gui.add_button("Hold this wind", hint="until the next start, on all sides")
            gui.add_markdown("0 is east, 90 is north. The scenario's own wind blows again from the next start on.")
        hold.on_click(self.guarded(lambda _: self._blow()))

    def click(self, cell: tuple[int, int]) -> None:
        """Do what a click on a cell is to do."""
        if self._click.value == _LOOK:
            return
        if self._click.value == _SEND:
            self.panel.drive.send_to(cell)
            return
        self.cell.value = cell
        self._act_on(cell, self._click.value == _LIGHT)

    def _act_on(self, cell: tuple[float, float], light: bool) -> None:
        row, column = (int(each) for each in cell)
        (self.match.ignite if light else self.match.clear)(row, column)
        self.page.show()

    def _blow(self) -> None:
        self.match.blow(float(self._speed.value), float(self._direction.value))
        self.page.show()
