"""The tab Agent: what the chosen vehicle's agent sees, and how likely it acts."""

from warp_torchrl.live import sight, words
from warp_torchrl.live.panel.picture import add_picture, png, show_picture
from warp_torchrl.live.panel.tab import Tab
from warp_torchrl.live.side import Side
from warp_torchrl.live.stage import change
from warp_torchrl.system.foreign_text import escaped_markdown


class AgentTab(Tab):
    """What one agent sees."""

    title = "Agent"

    def make(self) -> None:
        """Make a picture for each map that the agent sees."""
        self._who = self.gui.add_markdown("")
        self._chances = self.gui.add_html("")
        self._sights = {
            name: add_picture(self.gui, name or "observation")
            for name, value in sight.entries(self.side, 0).items()
            if value.ndim == 3
        }
        self._numbers = self.gui.add_html("")

    def paint(self) -> None:
        """Show what the chosen vehicle's agent sees now."""
        agent = self.panel.agent
        who, chances, numbers, pictures = self.once(("agent", agent), lambda: _shown(self.side, agent))
        change(self._who, content=who)
        change(self._chances, content=chances)
        change(self._numbers, content=numbers)
        for name, handle in self._sights.items():
            show_picture(handle, pictures[name])


def _shown(side: Side, agent: int) -> tuple[str, str, str, dict[str, bytes]]:
    """Return the heading of an agent's observation, its action probabilities, its numbers, and pictures of its maps."""
    return (
        f"What **{escaped_markdown(side.env.agent_names[agent])}** sees, and how likely it acts:",
        words.actions(side, agent),
        words.numbers_html(sight.named_numbers(side, agent)),
        {name: png(picture) for name, picture in sight.pictures(side, agent).items()},
    )
