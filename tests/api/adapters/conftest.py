"""Configurations are composed once for all tests of the adapters, which make many environments."""

from functools import lru_cache

import pytest

from warp_torchrl.api import make as api


@pytest.fixture(autouse=True, scope="session")
def _compose_once():
    composed = lru_cache(maxsize=None)(api.compose_config)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(api, "compose_config", lambda name, overrides: composed(name, tuple(overrides)))
        yield
