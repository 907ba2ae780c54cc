"""Parameters of former versions are found by the names of now."""

import pytest

from warp_torchrl.runs.former import parameters

NOW = ["loss.module.0.module.encoder.parts.0.weight", "loss.module.0.module.networks.1.body.1.bias", "entropy_coeff"]


@pytest.mark.parametrize(
    "former",
    [
        NOW,
        ["loss.module.0.module.network.encoder.parts.0.weight", "loss.module.0.module.network.networks.1.body.1.bias"],
        [
            "loss.module.0.module.1.module.encoder.parts.0.weight",
            "loss.module.0.module.1.module.networks.1.body.1.bias",
        ],
    ],
)
def test_wrappers_of_a_network_make_no_difference(former):
    found = parameters(dict(zip(former, range(3), strict=False)), NOW)
    assert list(found.items()) == list(zip(NOW, range(3), strict=False))[: len(former)]


def test_what_has_no_name_now_stays_as_it_is():
    state = {"loss.module.0.module.networks.2.body.1.bias": 1, "loss.module.0.module.body.1.weight": 2}
    assert parameters(state, NOW) == state
