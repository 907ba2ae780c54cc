"""The tab Record: what was played is saved, watched again, and learned from."""

from warp_torchrl.live import words
from warp_torchrl.live.learning import MOST_FRAMES
from warp_torchrl.live.match import Match
from warp_torchrl.live.panel.tab import Tab, chosen_option
from warp_torchrl.live.replayed import ReplayedMatch
from warp_torchrl.live.stage import change

_NONE = "none yet"
_FRAMES = 200_000
_TRAIN, _STOP, _PLAY = "Train", "Stop", "Play the new policy"


class RecordTab(Tab):
    """The recordings of the page's folder, and a training from them."""

    title = "Record"

    def make(self) -> None:
        """Make the buttons and the list."""
        gui, keeper = self.gui, self.page.keeper
        self._listed = -1
        self._so_far = gui.add_markdown("")
        save = gui.add_button("Save what was played")
        save.on_click(self.guarded(lambda _: self._save()))
        self._every = gui.add_checkbox("Keep every episode", keeper.every, hint="in which a person did something")
        self._every.on_update(self.guarded(lambda value: setattr(keeper, "every", value)))
        with gui.add_folder("Recordings"):
            self._list = gui.add_markdown("")
            self._which = gui.add_dropdown("Recording", (_NONE,), initial_value=_NONE)
            watch = gui.add_button("Watch it")
            watch.on_click(self.guarded(lambda _: self._watch()))
        with gui.add_folder("Train from what people did"):
            self._frames = gui.add_number("Steps", initial_value=_FRAMES, min=1, max=MOST_FRAMES, step=1000)
            train = gui.add_button_group("", (_TRAIN, _STOP, _PLAY))
            train.on_click(self.guarded(self._train))
            self._training = gui.add_markdown("")

    def paint(self) -> None:
        """Show how much was played, what is in the folder, and how far a training is."""
        keeper, learning = self.page.keeper, self.page.learning
        change(self._so_far, content=words.so_far(self.side))
        change(self._every, value=keeper.every)
        change(
            self._training, content=self.once("training", lambda: words.training(learning.status(), learning.newest()))
        )
        if self._listed != keeper.changes:
            self._listed = keeper.changes
            found, left_out = self.once("recordings", keeper.recordings)
            change(self._list, content=words.recordings(keeper.folder, found, left_out))
            self._which.options = tuple(found) or (_NONE,)
            self._which.value = self._which.options[-1]

    def _save(self) -> None:
        self.page.tell(f"saved {self.page.keeper.save(self.side)}")
        self.page.show()

    def _watch(self) -> None:
        name = chosen_option(self._which)
        self.page.open(ReplayedMatch(self.page.keeper.read(name), self.match.setting))

    def _train(self, button: str) -> None:
        learning = self.page.learning
        if button == _TRAIN:
            folder = learning.start(self.side, self.match.setting, int(self._frames.value))
            self.page.tell(f"a training has started, its log is in {folder}")
        elif button == _STOP:
            learning.stop()
        else:
            self.page.open(Match(learning.setting(self.match.setting.seed)))
        self.page.show()
