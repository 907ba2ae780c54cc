"""Fast backends of the laws, each equal to its law by a test."""
