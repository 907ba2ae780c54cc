"""Lists, checks and exports recordings: ``python -m warp_torchrl.demonstrations FOLDER``."""

import sys

from warp_torchrl.commands.demonstrations import main

if __name__ == "__main__":
    sys.exit(main())
