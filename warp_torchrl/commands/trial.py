"""A training of a search or of a live page: as ``train.py``; whoever starts it lets it end with itself."""

from warp_torchrl.commands.command import train

if __name__ == "__main__":
    train()
