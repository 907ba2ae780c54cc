"""Worlds as they were saved, by today's names and by earlier ones."""

import pytest
import torch

from tests.world.drawing import differing
from warp_torchrl.world.state.saved import filled
from warp_torchrl.world.state.state import count_trees
from warp_torchrl.world.terrain.array import Array
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

WORLD = World(landscape=Perlin(size=12, relief=80.0))


def start(first: int):
    return WORLD.reset(torch.arange(first, first + 3), torch.zeros(3, dtype=torch.int64))


def test_what_changes_is_all_that_has_to_be_saved() -> None:
    saved = start(0)
    assert differing(WORLD.restored(filled(start(40), saved.what_changes())), saved) == []


def test_worlds_of_earlier_names_are_read() -> None:
    saved = start(0)
    earlier = {name.replace("ground.landscape", "landscape"): leaf for name, leaf in saved.what_changes().items()}
    earlier["wind"] = earlier.pop("air.wind")
    earlier |= {f"tally.{name}": leaf for name, leaf in count_trees(saved).leaves().items()}
    earlier |= {"alpha": saved.alpha, "slope": saved.ground.slope, "gain": saved.air.wind, "chances": saved.air.wind}
    assert differing(WORLD.restored(filled(start(40), earlier)), saved) == []


def test_worlds_that_were_saved_before_landscapes_had_fuel_are_read_without_it() -> None:
    world = World(landscape=Array(cover=[[3] * 12] * 12, fuel=[[165] * 12] * 12, canopy_cover=[[50] * 12] * 12))
    saved = world.reset(torch.arange(3), torch.zeros(3, dtype=torch.int64))
    assert differing(world.restored(filled(saved, saved.what_changes())), saved) == []
    earlier = saved.what_changes()
    assert (earlier.pop("ground.landscape.fuel") == 165).all() and (
        earlier.pop("ground.landscape.canopy_cover") > 0
    ).all()
    read = world.restored(filled(saved, earlier))
    assert read.landscape.fuel is None and read.landscape.canopy_cover is None
    read[torch.tensor([1])] = saved[1:2]  # the next episode of a world has more than the batch that it joins
    assert torch.equal(read.cells, saved.cells)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda entries: entries.pop("cells"), "worlds must have the entries"),
        (lambda entries: entries.update(smoke=entries["cells"]), "worlds must have the entries"),
        (lambda entries: entries.update(cells=entries["cells"][:, 1:]), r"cells must be torch.uint8 \[3, 12, 12\]"),
        (lambda entries: entries.update(wet=entries["wet"].long()), r"wet must be torch.uint8 .*, got torch.int64"),
    ],
)
def test_what_does_not_fit_is_refused(change, message) -> None:
    entries = start(0).what_changes()
    change(entries)
    with pytest.raises(ValueError, match=message):
        filled(start(40), entries)
