"""Paired evaluation, its statistics and its report."""
