"""Hyperparameter search with Optuna: each trial is a training in a separate process, with a run folder."""
