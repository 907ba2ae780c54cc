"""The open questions of a match: actions of the policy that need a person's permission or choice."""

from warp_torchrl.live import words
from warp_torchrl.live.crew import Question
from warp_torchrl.live.panel.controls import Window
from warp_torchrl.live.stage import change

ANSWERS = ("Do it", "Don't")


class QuestionBox:
    """The open questions above the tabs.

    Where the policy is unsure its vehicles are asked about one at a time. Other questions are answered together.

    Args:
        panel: What it is part of.
    """

    def __init__(self, panel: Window) -> None:
        self._panel = panel
        self._asked: list[Question] = []
        gui = panel.gui
        self.folder = gui.add_folder("The match waits for your word", visible=False)
        with self.folder:
            self._text = gui.add_markdown("")
            self._chances = gui.add_html("", visible=False)
            word = gui.add_button_group("", ANSWERS)
        word.on_click(panel.guarded(lambda value: self.answer(value == ANSWERS[0])))

    def show(self) -> None:
        """Show the open questions."""
        side = self._panel.page.match.sides[0]
        # The policy proposes: its probabilities are of what it sees.
        self._asked = self._panel.page.once("asked", self._panel.page.match.questions)
        if self._asked and self._asked[0].chance is not None:
            self._asked = self._asked[:1]
            agent = self._asked[0].agent
            change(self._chances, content=self._panel.page.once(("asked", agent), lambda: words.actions(side, agent)))
        unsure = bool(self._asked) and self._asked[0].chance is not None
        change(self._chances, visible=unsure)
        change(self._text, content=words.questions(side, self._asked))
        change(self.folder, visible=bool(self._asked))

    def answer(self, allow: bool) -> None:
        """Answer the question that is shown; without one it does nothing."""
        if not self._asked:
            return
        for question in self._asked:
            self._panel.page.match.sides[0].crew.answer(question, allow)
        self._go_on()

    def choose(self, action: int) -> bool:
        """Let the vehicle whose policy is unsure do an action; return whether one is asked about.

        Raises:
            Refused: If the action would do nothing.
        """
        if not self._asked or self._asked[0].chance is None:
            return False
        self._panel.page.match.sides[0].choose(self._asked[0], action)
        self._go_on()
        return True

    def _go_on(self) -> None:
        page = self._panel.page
        self._asked = []
        if not page.playing:
            page.step()
        page.show()
