"""Arrays under the state: batches, draws, directions, and kernels on maps of bytes."""
