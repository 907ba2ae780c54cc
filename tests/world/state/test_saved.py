"""Worlds as they were saved, by today's names and by earlier ones."""

import pytest
import torch

from tests.world.drawing import differing
from warp_torchrl.world.state.saved import filled
from warp_torchrl.world.terrain.landscape import Perlin
from warp_torchrl.world.world import World

WORLD = World(landscape=Perlin(size=12, relief=80.0))


def start(first: int):
    return WORLD.reset(torch.arange(first, first + 3), torch.zeros(3, dtype=torch.int64))


def test_what_changes_is_all_that_has_to_be_saved() -> None:
    saved = start(0)
    assert differing(WORLD.restored(filled(start(40), saved.what_changes())), saved) == []


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
