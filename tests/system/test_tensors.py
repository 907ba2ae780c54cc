"""Numbers that are not finite are found wherever a file holds them."""

import math
import os
import zipfile
from pathlib import Path
from typing import Any

import pytest
import torch

from tests.forgery import forge
from tests.runs.test_checkpoint import saved
from warp_torchrl.runs.checkpoint import CheckpointError, newest
from warp_torchrl.system.checksummed import Unsound
from warp_torchrl.system.tensors import check_finite, load_tensors

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


def refused(path: Path, told: str) -> None:
    with pytest.raises(Unsound, match=rf"^{path} cannot be read: .*{told}") as raised:
        load_tensors(path)
    assert "\n" not in str(raised.value)


def test_what_torch_saves_is_read(tmp_path):
    weight = torch.arange(6.0).view(2, 3)
    content = {"weight": weight, "same": weight, "nested": [{"n": 3, "none": None}, (1, 2.5)], "empty": torch.zeros(0)}
    torch.save(content, tmp_path / "a.pt")
    found = load_tensors(tmp_path / "a.pt")
    assert torch.equal(found["same"], weight) and found["nested"] == content["nested"]


WIDE = {
    "one number expanded": lambda: torch.zeros(1).expand(2**40),
    "a number expanded a little": lambda: torch.zeros(1).expand(64),
    "a row expanded": lambda: torch.zeros(8, 1).expand(8, 2**30),
    "a stride of nothing": lambda: torch.zeros(4).as_strided((2**20, 2**20), (0, 0)),
}


@pytest.mark.parametrize("make", WIDE.values(), ids=WIDE)
def test_a_tensor_of_more_numbers_than_its_file_is_refused(tmp_path, make):
    torch.save({"policy": {"weight": make()}}, tmp_path / "a.pt")
    assert (tmp_path / "a.pt").stat().st_size < 10_000
    refused(tmp_path / "a.pt", r"policy.weight of shape .* must have no more numbers than the file")


ODD = {
    "sparse": lambda: torch.ones(3, 3).to_sparse(),
    "complex": lambda: torch.ones(3, dtype=torch.complex64),
    "without numbers": lambda: torch.ones(3, device="meta"),
    "quantised": lambda: torch.quantize_per_tensor(torch.ones(3), 0.1, 0, torch.quint8),
}


@pytest.mark.parametrize("make", ODD.values(), ids=ODD)
def test_a_tensor_that_no_network_holds_is_refused(tmp_path, make):
    torch.save({"weight": make()}, tmp_path / "a.pt")
    refused(tmp_path / "a.pt", "weight must be a plain tensor of real numbers")


def repacked(path: Path, compression: int, more: int = 0) -> None:
    """Write an archive of torch again, its first tensor with bytes of zero behind it."""
    with zipfile.ZipFile(path) as source:
        parts = {name: source.read(name) for name in source.namelist()}
    with zipfile.ZipFile(path, "w", compression) as made:
        for name, body in parts.items():
            made.writestr(name, body + bytes(more if name.endswith("/data/0") else 0))


def test_an_archive_that_unpacks_to_more_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    path = tmp_path / "a.pt"
    torch.save({"weight": torch.ones(4)}, path)
    repacked(path, zipfile.ZIP_STORED)
    assert load_tensors(path)["weight"].tolist() == [1, 1, 1, 1]
    repacked(path, zipfile.ZIP_DEFLATED, more=2**24)
    monkeypatch.setattr(torch, "load", lambda *given, **more: pytest.fail("it is unpacked"))
    refused(path, "one is compressed")


def test_parts_of_an_archive_that_lie_on_each_other_are_refused(tmp_path):
    path = tmp_path / "a.pt"
    torch.save({"weight": torch.ones(4000)}, path)
    content = bytearray(path.read_bytes())
    place = content.index(b"PK\1\2")  # each entry of the list says that its part is as large as the file
    while content[place : place + 4] == b"PK\1\2":
        content[place + 20 : place + 28] = len(content).to_bytes(4, "little") * 2
        lengths = [int.from_bytes(content[place + at : place + at + 2], "little") for at in (28, 30, 32)]
        place += 46 + sum(lengths)
    path.write_bytes(content)
    refused(path, "no larger than the file")


def test_an_archive_with_a_second_list_of_parts_is_refused(tmp_path):
    path = tmp_path / "a.pt"
    torch.save({"weight": torch.ones(4)}, path)
    content = path.read_bytes()
    for changed in (b"PK\5\6" + bytes(18) + content, content + b" ", content[:-2] + b"\1\0 ", content[:60], b""):
        path.write_bytes(changed)
        refused(path, "")
    for before in (b"x", b"PK\5\6" + bytes(18)):
        path.write_bytes(before + content)
        refused(path, "its end is not where it says|its list of parts is not where it says")
    repacked_twice = content + content  # which offset is meant?
    path.write_bytes(repacked_twice)
    refused(path, "its end is not where it says|its list of parts is not where it says")


def test_the_format_before_archives_is_refused(tmp_path):
    torch.save({"weight": torch.ones(4)}, tmp_path / "a.pt", _use_new_zipfile_serialization=False)
    refused(tmp_path / "a.pt", "it is no archive of torch.save")


def test_values_that_hold_each_other_end_at_once(tmp_path):
    laughs: list[Any] = [0] * 9
    for _ in range(12):
        laughs = [laughs] * 9
    circle: list[Any] = []
    circle.append(circle)
    for content in (laughs, circle):
        torch.save(content, tmp_path / "a.pt")
        refused(tmp_path / "a.pt", "nested at most 50 deep")


def test_a_pipe_in_place_of_a_file_is_refused(tmp_path):
    os.mkfifo(tmp_path / "a.pt")
    refused(tmp_path / "a.pt", "is no file")


@pytest.mark.parametrize(("name", "content"), [("policy.pt", [1]), ("policy.pt", {"a": 1}), ("training.pt", [1])])
def test_a_checkpoint_that_holds_something_else_is_refused(tmp_path, name, content):
    path = saved(tmp_path, 1)
    torch.save(content, path / name)
    forge(path)
    with pytest.raises(CheckpointError, match=rf"{name} must hold"):
        getattr(newest(tmp_path)[0], name.removesuffix(".pt"))()
