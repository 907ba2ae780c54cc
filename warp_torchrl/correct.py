"""A scripted person corrects a policy: ``python -m warp_torchrl.correct policy=RUN out=FOLDER``."""

import sys

from warp_torchrl.commands.correct import main

if __name__ == "__main__":
    sys.exit(main())
