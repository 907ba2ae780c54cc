"""Observations as one vector, and back."""

import numpy as np
import pytest

from warp_torchrl.env.flat import flattened, unflattened

SHAPES = {"view": ((2, 2), "uint8"), "status": ((3,), "float32")}


def test_entries_come_in_the_order_of_their_names_and_bytes_are_shares():
    view, own = np.array([[0, 255], [51, 102]], np.uint8), np.array([-3.0, 0.5, 2.0], np.float32)
    vector = flattened({"view": view, "status": own})
    assert vector.dtype == np.float32 and vector == pytest.approx([-3.0, 0.5, 2.0, 0.0, 1.0, 0.2, 0.4])


def test_every_byte_comes_back_in_batches_too():
    view = np.arange(256, dtype=np.uint8).reshape(64, 2, 2)
    own = np.random.default_rng(0).normal(size=(64, 3)).astype(np.float32)
    vectors = flattened({"view": view, "status": own}, n_batch=1)
    assert vectors.shape == (64, 7)
    back = unflattened(vectors, SHAPES)
    assert (back["view"] == view).all() and back["view"].dtype == np.uint8 and (back["status"] == own).all()


@pytest.mark.parametrize("vector", [np.zeros(6, np.float32), np.zeros(7)])
def test_another_vector_is_refused(vector):
    with pytest.raises(ValueError, match=r"what must be float32 of shape \[\.\.\., 7\], got"):
        unflattened(vector, SHAPES, "what")
