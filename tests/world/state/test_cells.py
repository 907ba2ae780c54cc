"""The fast words of cell codes say what the law's plain comparisons do."""

import pytest
import torch

from warp_torchrl.world.law import cells as law
from warp_torchrl.world.state import cells


@pytest.mark.parametrize("word", ["is_burning", "is_tree", "holds_trees"])
def test_each_byte_is_read_as_the_law_reads_it(word: str) -> None:
    codes = torch.arange(256, dtype=torch.uint8)
    assert torch.equal(getattr(cells, word)(codes), getattr(law, word)(codes))
