"""Scores and fits the law of fires in metres and minutes: ``python -m warp_torchrl.calibrate``."""

import sys

from warp_torchrl.commands.calibrate import main

if __name__ == "__main__":
    sys.exit(main())
