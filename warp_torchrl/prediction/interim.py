"""Interim."""

import csv

import torch


def read_ignition(path, grid):
    lit = torch.zeros(grid.shape, dtype=torch.bool)
    for row in csv.DictReader(open(path)):
        lit[int(row["row"]), int(row["column"])] = True
    return lit
