"""Nested mappings by dotted keys."""

from warp_torchrl.dotted import dotted


def test_what_stands_in_mappings_is_found_by_dotted_keys_in_order():
    node = {"fire": {"tau": 5.0, "alpha": [0.1, 0.2]}, "seed": 3, "landscape": {"table": {11: 3}}, "none": {}}
    assert list(dotted(node).items()) == [
        ("fire.tau", 5.0),
        ("fire.alpha", [0.1, 0.2]),
        ("seed", 3),
        ("landscape.table.11", 3),
    ]
    assert dotted({"b": 1}, "a.") == {"a.b": 1}
