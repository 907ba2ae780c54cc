"""Model with convolutions over pictures."""

from dataclasses import dataclass
from typing import ClassVar, Literal

from warp_torchrl.models.model import ACTIVATIONS, Mlp, check_sizes
from warp_torchrl.models.networks import ConvolutionalEncoder
from warp_torchrl.models.signature import Entry


@dataclass(frozen=True, kw_only=True)
class Cnn(Mlp):
    """Convolutions over pictures (the view, the map pooled to 8 x 8, the state), then as ``Mlp``.

    Attributes:
        channels: Output channels of each convolution.
        kernel_size: Of each, odd.

    Raises:
        ValueError: If a size is out of range or the kernel is even.
    """

    activation: Literal["tanh", "relu"] = "relu"
    dtype: Literal["auto", "float32", "bfloat16"] = "float32"
    channels: tuple[int, ...] = (16, 16)
    kernel_size: int = 3
    _packs: ClassVar[bool] = False  # convolutions read whole planes

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sizes("channels", self.channels)
        if not (1 <= self.kernel_size <= 15 and self.kernel_size % 2):
            raise ValueError(f"kernel_size must be odd and in 1..15, got {self.kernel_size}")

    def _encoder(self, entries: list[Entry], size: int) -> ConvolutionalEncoder:
        return ConvolutionalEncoder(entries, size, tuple(self.channels), self.kernel_size, ACTIVATIONS[self.activation])
