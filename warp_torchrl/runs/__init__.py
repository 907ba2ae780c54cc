"""Runs on disk: folders, checkpoints, logs, and how a run goes on."""
