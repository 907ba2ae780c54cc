"""What the exit code of a command says: docs/reliability.md. A signal's is 128 + its number, a fault of ours 1."""

DONE, MISTAKE, IN_USE, UNSOUND, NUMERICAL, DISK = 0, 2, 3, 4, 5, 6
