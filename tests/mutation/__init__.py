"""Mutants: the package with one small fault each, which the tests beside it must notice."""
