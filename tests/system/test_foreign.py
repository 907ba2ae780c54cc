"""Files that others wrote."""

import os

import pytest

from warp_torchrl.system.foreign import Foreign, path_below, read_bytes, read_json, read_text


def test_only_regular_files_of_a_bounded_size_are_read(tmp_path):
    os.mkfifo(tmp_path / "pipe")  # to open it would wait for a writer
    (tmp_path / "four").write_bytes(b"four")
    for name, why in (("pipe", "is no file"), ("", "is no file"), ("four", "too large: 4 bytes, at most 3")):
        with pytest.raises(Foreign, match=why):
            read_bytes(tmp_path / name, 3)
    with pytest.raises(Foreign, match="is no file"):
        read_bytes("/dev/zero", 3)
    assert read_bytes(tmp_path / "four", 4) == b"four"


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="no files of a kernel")  # noqa: PTH110
def test_a_file_that_is_longer_than_it_says_is_read_to_the_bound_alone():
    assert os.stat("/proc/self/status").st_size == 0  # noqa: PTH116
    with pytest.raises(Foreign, match="at most 10 bytes"):
        read_bytes("/proc/self/status", 10)


@pytest.mark.parametrize(
    "content, why", [(b"\xff\xfeh", "must be UTF-8: byte 0"), (b"a\0b", "holds a NUL")], ids=["no UTF-8", "a NUL"]
)
def test_a_text_is_utf_8_without_nul(tmp_path, content, why):
    (tmp_path / "text").write_bytes(content)
    with pytest.raises(Foreign, match=why):
        read_text(tmp_path / "text", 100)


def test_a_byte_order_mark_is_left_out(tmp_path):
    (tmp_path / "text").write_bytes(b"\xef\xbb\xbf{}")
    assert read_text(tmp_path / "text", 100) == "{}"
    assert read_json(tmp_path / "text", 100) == {}


@pytest.mark.parametrize(
    "text, why",
    [
        ('{"a": NaN}', "NaN is no number"),
        ('{"a": -Infinity}', "-Infinity is no number"),
        ('{"a": 1e999}', "too large for a number"),
        ('{"a": {"b": 1, "b": 2}}', "key 'b' is there twice"),
        ("[" * 100_000, "nested too deep"),
        ("{", "no JSON"),
    ],
)
def test_json_is_what_its_standard_says(tmp_path, text, why):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(Foreign, match=why):
        read_json(tmp_path / "a.json", 1_000_000)


@pytest.mark.parametrize(
    "name", ["../a", "/etc/hosts", "a/../b", "a//b", "", ".a", "-a", "a\n", "a\\b", "é", "x" * 2000]
)
def test_a_manifest_names_plain_files_below_its_folder(tmp_path, name):
    with pytest.raises(Foreign, match="no plain name"):
        path_below(tmp_path, name)


def test_files_of_a_manifest_are_no_links(tmp_path):
    (tmp_path / "steps").mkdir()
    (tmp_path / "steps" / "a.memmap").touch()
    (tmp_path / "link").symlink_to("steps")
    assert path_below(tmp_path, "steps/a.memmap") == tmp_path / "steps" / "a.memmap"
    with pytest.raises(Foreign, match="is a link"):
        path_below(tmp_path, "link/a.memmap")
