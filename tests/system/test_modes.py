"""What is computed apart from torch's modes does not depend on them."""

import pytest
import torch

from warp_torchrl.system.modes import apart, kept

MODES = {
    "float64": lambda: _default_type(torch.float64),
    "float16": lambda: _default_type(torch.float16),
    "inference": torch.inference_mode,
    "meta": lambda: torch.device("meta"),
    "autocast": lambda: torch.autocast("cpu", dtype=torch.bfloat16),
    "no_grad": torch.no_grad,
}
"""Each a context."""


class _default_type:  # noqa: N801
    def __init__(self, kind):
        self.kind = kind

    def __enter__(self):
        self.before = torch.get_default_dtype()
        torch.set_default_dtype(self.kind)

    def __exit__(self, *error):
        torch.set_default_dtype(self.before)


def made():
    """What depends on every mode: a new tensor, a quotient of whole numbers, a product of matrices."""
    half = torch.arange(3) / 2
    return torch.zeros(3), half, half[None] @ half[:, None], torch.is_grad_enabled()


@pytest.mark.parametrize("mode", MODES)
def test_a_function_apart_computes_as_without_a_mode(mode):
    expected, before = made(), torch.get_default_dtype()
    with MODES[mode]():
        *found, records = apart(made)()
        assert records == (mode not in ("inference", "no_grad")) == torch.is_grad_enabled()
        again = torch.zeros(1)
    for one, other in zip(found, expected, strict=False):
        assert one.dtype == other.dtype == torch.float32 and torch.equal(one, other) and not one.is_inference()
    assert torch.get_default_dtype() == before and torch.zeros(1).device.type == "cpu"
    assert (again.dtype, again.device.type, again.is_inference()) == (
        {"float64": torch.float64, "float16": torch.float16}.get(mode, torch.float32),
        "meta" if mode == "meta" else "cpu",
        mode == "inference",
    ), "inside of the mode all else is as it was"


def test_an_error_leaves_the_modes_as_they_were():
    @apart
    def fails():
        raise ValueError("no")

    with _default_type(torch.float64), torch.inference_mode():
        with pytest.raises(ValueError, match="no"):
            fails()
        assert torch.zeros(1).dtype == torch.float64 and torch.zeros(1).is_inference()


def test_what_is_kept_is_made_once_and_can_be_learned_from():
    calls = []

    @kept(4)
    def constant(length):
        calls.append(length)
        return torch.arange(length) / 2

    with torch.inference_mode(), _default_type(torch.float64):
        first = constant(3)
    weight = torch.ones(3, requires_grad=True)
    (weight * constant(3)).sum().backward()  # which a tensor of inference mode refuses
    assert constant(3) is first and calls == [3] and weight.grad.tolist() == [0.0, 0.5, 1.0]
