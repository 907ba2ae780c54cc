"""The tab Agent: what the chosen vehicle's agent sees, and how likely it acts."""

from warp_torchrl.live import sight, words
from warp_torchrl.live.panel.tab import Tab
from warp_torchrl.live.stage import change


class AgentTab(Tab):
    """What one agent sees."""

    title = "Agent"

    def make(self) -> None:
        """Make a picture for each map that the agent sees."""
        self._who = self.gui.add_markdown("")
        self._chances = self.gui.add_html("")
        self._sights = {
            name: self.gui.add_image(picture, label=name or "observation", format="png")
            for name, picture in sight.pictures(self.side, 0).items()
        }
        self._told = self.gui.add_html("")

    def paint(self) -> None:
        """Show what the chosen vehicle's agent sees now."""
        side, agent = self.side, self.panel.agent
        change(self._who, content=f"What **{side.env.agent_names[agent]}** sees, and how likely it acts:")
        change(self._chances, content=words.actions(side, agent))
        change(self._told, content=words.told(sight.numbers(side, agent)))
        pictures = sight.pictures(side, agent)
        for name, handle in self._sights.items():
            change(handle, image=pictures[name])
