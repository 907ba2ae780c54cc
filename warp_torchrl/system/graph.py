"""Functions of tensors that a GPU plays again without the program: CUDA graphs.

Eager, a step is a thousand operations, each of which the program starts, some microseconds apart; a GPU has done most
of them sooner. Recorded, they are started as one.
"""

from collections.abc import Callable, Sequence

import torch
from torch import Tensor

WARM_UP = 3
"""Calls before one is recorded, in which constants, gradients and an optimiser's state come to be."""

Function = Callable[[list[Tensor]], list[Tensor]]


class Graph:
    """A function of tensors of the same shapes at every call, recorded by a GPU.

    It must do the same at every call: no number that it takes from elsewhere may change, except in tensors that keep
    their place. A CPU calls it each time, from and to the same tensors as a GPU would: all but the recording is tested.

    Args:
        function: Takes and returns lists of tensors; it may change tensors that it does not take.
    """

    def __init__(self, function: Function) -> None:
        self._function = function
        self._calls = 0
        self._given: list[Tensor] = []
        self._made: list[Tensor] = []
        self._graph: torch.cuda.CUDAGraph | None = None

    def __call__(self, tensors: Sequence[Tensor]) -> list[Tensor]:
        """Return what the function makes of the tensors: its own copies, but the given ones where it returns those."""
        if not self._given:
            self._given = [each.clone() for each in tensors]
        else:
            torch._foreach_copy_(self._given, list(tensors))
        self._play()
        places = {id(each): place for place, each in enumerate(self._given)}
        return [tensors[places[id(each)]] if id(each) in places else each.clone() for each in self._made]

    def _play(self) -> None:
        self._calls += 1
        if self._graph is not None:
            self._graph.replay()
        elif self._given[0].is_cuda and self._calls > WARM_UP:
            self._graph = torch.cuda.CUDAGraph()
            with torch.cuda.graph(self._graph):
                self._made = self._function(self._given)
            self._graph.replay()  # while it is recorded nothing is computed
        elif self._given[0].is_cuda:
            self._aside()
        else:
            self._again()

    def _again(self) -> None:
        """Call the function where nothing is recorded, with its results in the places of the last call's."""
        made = self._function(self._given)
        self._made = self._made or made
        for known, new in zip(self._made, made, strict=True):
            known.copy_(new)

    def _aside(self) -> None:
        """Call the function on a stream of its own, as torch asks for before a recording."""
        stream, here = torch.cuda.Stream(), torch.cuda.current_stream()
        stream.wait_stream(here)
        with torch.cuda.stream(stream):
            self._made = self._function(self._given)
        here.wait_stream(stream)
