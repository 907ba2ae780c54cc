"""Predicts fires alone on real ground: ``python -m warp_torchrl.predict``.

The function of that name, ``from warp_torchrl import predict``, is in ``warp_torchrl.prediction.predict``.
"""

import sys

from warp_torchrl.commands.predict import main

if __name__ == "__main__":
    sys.exit(main())
