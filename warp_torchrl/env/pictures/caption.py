"""Captions of an episode's pictures."""

from warp_torchrl.world.state.cells import count_trees
from warp_torchrl.world.state.state import WorldState
from warp_torchrl.world.world import World


def progress(state: WorldState, world: World) -> str:
    """Return the clock of world 0, and what its mechanics say of it; else the forest saved and burning."""
    clock = f"step {int(state.step[0])} of {world.horizon}"
    if world.fire.minutes is not None:
        hours, minutes = divmod(round(int(state.tick[0]) * world.fire.minutes), 60)
        clock += f", {hours} h {minutes:02d} min"
    counts = count_trees(state)
    forest = f"{float(counts.saved()[0]):.0%} saved", f"{float(counts.burning[0] / counts.initial[0]):.0%} burning"
    return f"{clock}:  {', '.join([line for each in world.loop for line in each.caption(state)] or forest)}"
