"""Tensors that are made once."""

import torch

from warp_torchrl.world.constants import counting, numbers

CPU = torch.device("cpu")
FIVE = (0.5, 1.5, 2.5, 3.5, 4.5)


def test_they_are_made_once() -> None:
    assert counting(5, CPU) is counting(5, CPU) and numbers(FIVE, CPU) is numbers(FIVE, CPU)
    assert counting(5, CPU).dtype == torch.int32 and counting(5, CPU).tolist() == [0, 1, 2, 3, 4]
    assert numbers(FIVE, CPU).dtype == torch.float32 and tuple(numbers(FIVE, CPU).tolist()) == FIVE


def test_a_function_that_is_compiled_reads_them() -> None:
    operations = []

    def backend(graph: torch.fx.GraphModule, _: list[torch.Tensor]) -> torch.fx.GraphModule:
        operations.extend(str(node.target) for node in graph.graph.nodes if node.op.startswith("call"))
        return graph

    @torch.compile(backend=backend, fullgraph=True)
    def joined(given: torch.Tensor) -> torch.Tensor:
        return given * counting(5, given.device) + numbers(FIVE, given.device)

    assert joined(torch.full((5,), 2.0)).tolist() == [0.5, 3.5, 6.5, 9.5, 12.5]
    assert len(operations) == 2, operations  # a product and a sum: nothing makes numbers
