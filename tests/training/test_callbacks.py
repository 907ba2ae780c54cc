"""Callbacks have the hooks that they want, and are refused where they have none."""

import pytest

from warp_torchrl.training.callbacks import Callbacks


class Noting:
    def __init__(self, name, notes):
        self.name, self.notes = name, notes

    def on_batch(self, training, row):
        self.notes.append((self.name, row))


class Ending(Noting):
    def on_end(self, training):
        self.notes.append((self.name, "end"))
        raise OSError(self.name)


def test_hooks_are_called_in_the_order_of_the_callbacks_where_there_are_any():
    notes = []
    callbacks = Callbacks([Noting("a", notes), Ending("b", notes)])
    callbacks.call("on_batch", None, 1)
    callbacks.call("on_checkpoint", None, None)
    assert notes == [("a", 1), ("b", 1)]


def test_every_callback_ends_also_where_one_fails():
    notes = []
    with pytest.raises(OSError, match="b"):
        Callbacks([Ending("a", notes), Noting("-", notes), Ending("b", notes)]).end(None)
    assert notes == [("a", "end"), ("b", "end")]


class Mistyped:
    def on_batches(self, training, row):
        raise AssertionError


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (Noting("a", []), "callbacks must be a list of objects, got"),
        ([Noting], "callbacks must be objects with some of on_batch, .*, on_end, got the class Noting"),
        ([print], "callbacks must be objects with some of on_batch"),
        ([Mistyped()], "did you mean on_batch?"),
    ],
)
def test_what_has_no_hook_is_refused_in_a_line(given, told):
    with pytest.raises(ValueError, match=told):
        Callbacks(given)
