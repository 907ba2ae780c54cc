"""Searches values for any keys of a training: ``python -m warp_torchrl.search``."""

import sys

from warp_torchrl.commands.search import main

if __name__ == "__main__":
    sys.exit(main())
