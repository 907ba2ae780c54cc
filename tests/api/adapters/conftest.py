"""Configurations are composed once for all tests of the adapters, which make many environments."""

from copy import deepcopy
from functools import lru_cache

import pytest

from warp_torchrl.api import make as api


@pytest.fixture(autouse=True, scope="session")
def _compose_once():
    composed = lru_cache(maxsize=None)(api.compose_environment)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(api, "compose_environment", lambda overrides: deepcopy(composed(tuple(overrides))))
        yield
