"""Memory that may still be taken: the least of what the machine, a container and the process have left."""

import resource

import pytest

from warp_torchrl.system import memory


@pytest.fixture
def group(tmp_path, monkeypatch):
    """A container's control group, and no other."""

    def make(limit, used, files):
        (tmp_path / "memory.max").write_text(f"{limit}\n")
        (tmp_path / "memory.current").write_text(f"{used}\n")
        (tmp_path / "memory.stat").write_text(f"anon 5\ninactive_file {files}\nactive_file 7\n")

    monkeypatch.setattr(memory, "_CGROUPS", ((str(tmp_path), "memory.max", "memory.current"),))
    monkeypatch.setattr(memory, "_of_machine", lambda: 10_000)
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    return make


def test_a_container_s_limit_counts_without_copies_of_files(group):
    group(5_000, 3_000, 400)
    assert memory.available() == 2_400
    group(50_000, 3_000, 400)
    assert memory.available() == 10_000
    group("max", 3_000, 400)
    assert memory.available() == 10_000
    group(1_000, 3_000, 400)
    assert memory.available() == 0


def test_a_process_s_own_limit_counts_what_it_has_taken(group, monkeypatch):
    monkeypatch.setattr(resource, "getrlimit", lambda _: (9_000, 9_000))
    monkeypatch.setattr(memory, "_address_space", lambda: 2_000)
    assert memory.available() == 7_000


def test_this_machine_says_what_it_has():
    assert 2**20 < memory._of_machine() < 2**50 and memory._address_space() > 2**20


def test_what_does_not_fit_is_told_with_ways_out():
    line = str(memory.too_little("a fire in a window of 9 x 9 cells", 3e9, 1e9))
    assert line.startswith("memory must hold a fire in a window of 9 x 9 cells, which wants 3.0 GB, got 1.0 GB: ")
    assert all(way in line for way in ("landscape.size", "fewer hours", "fewer fires")) and "\n" not in line
