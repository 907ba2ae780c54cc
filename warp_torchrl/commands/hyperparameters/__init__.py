"""Hyperparameter search with Optuna: trials are trainings in processes of their own, each a run folder."""
