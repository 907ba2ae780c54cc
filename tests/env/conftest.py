"""The ground of the scenarios that are of a map."""

import pytest


@pytest.fixture(scope="session")
def maps(tmp_path_factory):
    """The folder where their layers are written."""
    return tmp_path_factory.mktemp("maps")
