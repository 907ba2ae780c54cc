"""Predicts fires alone on real ground: ``python -m warp_torchrl.predict``; the function is in ``prediction.predict``."""

import sys

from warp_torchrl.commands.predict import main

if __name__ == "__main__":
    sys.exit(main())
