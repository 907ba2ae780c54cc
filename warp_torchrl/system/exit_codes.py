"""Exit codes of the commands: docs/reliability.md. A signal's is 128 + its number, an internal error's 1."""

DONE, MISTAKE, IN_USE, UNSOUND, NUMERICAL, DISK = 0, 2, 3, 4, 5, 6
