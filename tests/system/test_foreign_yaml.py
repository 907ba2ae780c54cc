"""YAML of others: what is plain is read, and all else refused in one line, at once."""

import os
import re

import pytest

from warp_torchrl.system.foreign import Foreign
from warp_torchrl.system.foreign_yaml import read_words, read_yaml

LAUGHS = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{chr(98 + at)}: &{chr(98 + at)} [{','.join([f'*{chr(97 + at)}'] * 9)}]\n" for at in range(9)
)


def test_plain_values_are_read(tmp_path):
    path = tmp_path / "a.yaml"
    path.write_text("\ufeffa: {b: [1, 2.5, yes, null, 'text', 010]}\n2: x\n", encoding="utf-8")
    assert read_yaml(path) == {"a": {"b": [1, 2.5, True, None, "text", 8]}, 2: "x"}
    assert read_words(path) == {"a": {"b": ["1", "2.5", "yes", "null", "text", "010"]}, "2": "x"}
    path.write_text("# nothing\n")
    assert read_yaml(path) is None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (LAUGHS, "line 2 has an alias, *a: write out what it stands for"),
        ("a: &a {b: 1}\nc: {<<: {d: 1}}\n", "line 2 has a key that is no text or number"),
        ("a: 1\nb:\n  c: 1\n  c: 2\n", "line 4 has the key c once more"),
        ("a: 1\n'a': 2\n", "line 2 has the key a once more"),
        ("? [1, 2]\n: 3\n", "line 1 has a key that is no text or number"),
        ("a: !!python/object/apply:os.system ['true']\n", "line 1 has a tag"),
        ("a: !!binary aGVsbG8=\n", "line 1 has a tag"),
        ("a: !!set {b}\n", "line 1 has a tag"),
        ("a: ! b\n", "line 1 has a tag"),
        ("a: .nan\n", "numbers must be finite, got nan"),
        ("a: [-.inf]\n", "numbers must be finite, got -inf"),
        ("a: 1.0e+999\n", "numbers must be finite, got inf"),
        (f"a: {'9' * 5000}\n", "is no YAML that is read"),
        ("a: " + "[" * 31 + "]" * 31, "line 1 is nested more than 30 deep"),
        ("a: " + "[" * 100_000, "is no YAML that is read"),
        ("a: [" + "1," * 100_001 + "]", "it has more than 50000 values"),
        ("a: b: c\n", "mapping values are not allowed"),
        ("a: 1\n--- \nb: 1\n", "expected a single document"),
        ("a: \x01\n", "is no YAML that is read"),
        ("a: 2026-13-45\n", "is no YAML that is read"),
        ("a: \0\n", "holds a NUL"),
        ("x" * 1_000_001, "too large"),
    ],
    ids=lambda each: each[:12],
)
def test_what_is_not_plain_is_refused_in_one_line(tmp_path, text, told):
    path = tmp_path / "a.yaml"
    path.write_text(text)
    with pytest.raises(Foreign, match=re.escape(told)) as raised:
        read_yaml(path)
    assert "\n" not in str(raised.value) and str(path) in str(raised.value) and len(str(raised.value)) < 500


def test_a_pipe_is_refused(tmp_path):
    os.mkfifo(tmp_path / "a.yaml")
    with pytest.raises(Foreign, match="is no file"):
        read_yaml(tmp_path / "a.yaml")
