"""Learners, each from TorchRL's own loss."""
