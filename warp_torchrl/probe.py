"""What can be read from the messages of a team: ``python -m warp_torchrl.probe policy=RUN``."""

import sys

from warp_torchrl.commands.probe import main

if __name__ == "__main__":
    sys.exit(main())
