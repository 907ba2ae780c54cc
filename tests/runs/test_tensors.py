"""Numbers that are not finite are found wherever a file holds them."""

import math
from pathlib import Path

import pytest
import torch

from tests.forgery import forge
from tests.runs.test_checkpoint import saved
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.runs.sealed import Unsound
from warp_torchrl.runs.tensors import check_finite

NAN, INF = math.nan, math.inf


def test_what_is_finite_passes():
    kinds = (torch.float16, torch.bfloat16, torch.float32, torch.float64, torch.int64, torch.uint8, torch.bool)
    tensors = {str(kind): torch.ones(2, 3).to(kind) for kind in kinds}
    check_finite(Path("a.pt"), {"tensors": tensors, "empty": torch.zeros(0), "plain": [1, 2.5, None, "nan", True]})


@pytest.mark.parametrize("kind", [torch.float16, torch.bfloat16, torch.float32, torch.float64])
@pytest.mark.parametrize("number", [NAN, INF, -INF])
def test_a_number_that_is_not_finite_is_named_with_its_tensor(kind, number):
    values = torch.ones(4, 4, dtype=kind)
    values[2, 3] = number
    with pytest.raises(Unsound, match=f"^a.pt must hold finite numbers alone, and loss.0.weight holds {number:g}$"):
        check_finite(Path("a.pt"), {"sound": torch.ones(2), "loss": [{"weight": values}]})


def test_a_plain_number_that_is_not_finite_is_named():
    with pytest.raises(Unsound, match=r"optimizer\.lr holds inf"):
        check_finite(Path("a.pt"), {"optimizer": {"lr": INF}})


@pytest.mark.parametrize(("name", "read"), [("policy.pt", "policy"), ("training.pt", "training")])
def test_a_checkpoint_that_holds_one_is_refused_though_its_checksums_are_right(tmp_path, name, read):
    path = saved(tmp_path, 1)
    content = torch.load(path / name, weights_only=True) | {"weight": torch.tensor([1.0, NAN])}
    torch.save(content, path / name)
    forge(path)
    with pytest.raises(CheckpointError, match=f"{name} must hold finite numbers alone, and weight holds nan"):
        getattr(newest(tmp_path)[0], read)()


def test_tensors_without_numbers_of_their_own_are_not_read(tmp_path):
    path = saved(tmp_path, 1)
    torch.save({"weight": torch.ones(2, device="meta")}, path / "policy.pt")
    forge(path)
    with pytest.raises(CheckpointError, match=r"policy.pt cannot be read"):
        newest(tmp_path)[0].policy()
