"""Boards: frozen lists of tasks, rows of policies that played them, and tables of rows."""
