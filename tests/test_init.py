"""The package itself: public names, imported when they are used."""

import subprocess
import sys

import pytest

import warp_torchrl


def test_its_public_names_are_there_and_no_others():
    assert dir(warp_torchrl) == sorted(warp_torchrl.__all__)
    assert all(getattr(warp_torchrl, name) is not None for name in warp_torchrl.__all__)
    with pytest.raises(AttributeError, match=r"module 'warp_torchrl' has no attribute 'make'"):
        _ = warp_torchrl.make


def test_importing_it_imports_no_torch():
    code = "import sys, warp_torchrl; print({'torch', 'torchrl', 'hydra', 'matplotlib'} & sys.modules.keys())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
