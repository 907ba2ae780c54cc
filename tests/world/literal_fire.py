"""One tick of the fire as world.md words it: cell by cell, in plain Python floats.

Written from the specification alone, to be compared with the tensor code.
"""

import math
from dataclasses import dataclass, field
from functools import cache

LAKE, WETLAND, GRASSLAND, FOREST, BARE = range(5)
NEIGHBOURS = [(row, column) for row in (-1, 0, 1) for column in (-1, 0, 1) if (row, column) != (0, 0)]


@dataclass
class LiteralFire:
    """The automaton over lists of rows."""

    cells: list[list[int]]
    cover: list[list[int]]
    elevation: list[list[float]]
    wind: list[list[tuple[float, float]]]
    wet: list[list[int]]
    firebreak: list[list[bool]]
    growth: bool = True
    beta: float = 0.0
    p_regrow: float = 0.0
    burning_stages: int = 4
    oldest: int = 10
    divide_by_distance: bool = True
    law: str = "paper"
    refinement: int = 1
    kernel: str = "alexandridis"
    slope_gain: float = 0.078
    four_neighbours: bool = False
    stage_age: list[list[int]] | None = None
    alpha: dict[int, float] = field(
        default_factory=lambda: {LAKE: 0.0, WETLAND: 0.1, GRASSLAND: 1.0, FOREST: 0.8, BARE: 0.0}
    )

    @property
    def size(self) -> tuple[int, int]:
        return len(self.cells), len(self.cells[0])

    def can_ignite(self, row: int, column: int) -> bool:
        return 2 <= self.cells[row][column] <= 10 and self.wet[row][column] == 0

    def spreads(self, row: int, column: int) -> bool:
        height, width = self.size
        on_map = 0 <= row < height and 0 <= column < width
        return on_map and 11 <= self.cells[row][column] <= 10 + self.burning_stages

    def chance_across(self, source: tuple[int, int], target: tuple[int, int]) -> float:
        """Return p_d = clip(alpha w_d s_d / dist_d, 0, 1)."""
        south, east = target[0] - source[0], target[1] - source[1]
        distance = math.hypot(south, east)
        u, v = self.wind[source[0]][source[1]]
        speed = math.hypot(u, v)
        cosine = (u * east - v * south) / (speed * distance) if speed > 0 else 1.0
        climb = self.elevation[target[0]][target[1]] - self.elevation[source[0]][source[1]]
        slope = math.exp(self.slope_gain * math.degrees(math.atan(climb / (30.0 * distance))))
        help_ = self.wind_factor(speed, cosine) * slope / (distance if self.divide_by_distance else 1.0)
        alpha = self.alpha[self.cover[target[0]][target[1]]]
        if self.law == "paper":
            return min(1.0, alpha * help_)
        hazard = -math.log(1.0 - min(alpha, 0.95)) / self.refinement * help_
        return 1.0 - math.exp(-hazard)

    def wind_factor(self, speed: float, cosine: float) -> float:
        """Return w_d of the angle between wind and direction."""
        if self.kernel == "alexandridis":
            return math.exp(0.045 * speed) * math.exp(0.131 * speed * (cosine - 1.0))
        ratio = 1.0 + 8.729 * (1.0 - math.exp(-0.030 * 3.6 * speed)) ** 2.155
        eccentricity = math.sqrt(1.0 - 1.0 / ratio**2)
        if self.kernel == "fbp":
            return fbp_factor(speed, math.acos(max(-1.0, min(1.0, cosine))), ratio, eccentricity)
        return (math.exp(0.16 * speed) * (1.0 - eccentricity) / (1.0 - eccentricity * cosine)) ** 1.67

    def in_a_tick(self, chance: float) -> float:
        """Return the chance in a tick of what has this chance in a tick of the paper."""
        return 1.0 - (1.0 - chance) ** (1.0 / self.refinement)

    def neighbours(self) -> list[tuple[int, int]]:
        return [(row, column) for row, column in NEIGHBOURS if not (self.four_neighbours and row and column)]

    def chance_from_neighbours(self, row: int, column: int) -> float:
        """Return p_spread = 1 - prod (1 - p_d) over the neighbours that spread."""
        if not self.can_ignite(row, column):
            return 0.0
        escapes = 1.0
        for south, east in self.neighbours():
            source = (row + south, column + east)
            if self.spreads(*source):
                escapes *= 1.0 - self.chance_across(source, (row, column))
        return 1.0 - escapes

    def expected_to_ignite(self, row: int, column: int) -> float:
        """Return how many neighbours a burning cell is expected to ignite by itself."""
        height, width = self.size
        total = 0.0
        for south, east in self.neighbours():
            target = (row + south, column + east)
            on_map = 0 <= target[0] < height and 0 <= target[1] < width
            if self.spreads(row, column) and on_map and self.can_ignite(*target):
                total += self.chance_across((row, column), target)
        return total

    def chance_to_ignite(self, row: int, column: int) -> float:
        """Return q = p_spont + (1 - p_spont) p_spread."""
        if not self.can_ignite(row, column):
            return 0.0
        height, width = self.size
        age = self.cells[row][column]
        if age > self.oldest:
            return self.chance_from_neighbours(row, column)
        spontaneous = min(1.0, self.beta * math.exp(10.0 * age / self.oldest) / math.exp(10.0) / (height * width))
        spontaneous = self.in_a_tick(spontaneous)
        return spontaneous + (1.0 - spontaneous) * self.chance_from_neighbours(row, column)

    def outcomes(self, row: int, column: int) -> dict[int, float]:
        """Return the chance of each code that the cell may have after the tick."""
        code = self.cells[row][column]
        if code >= 11 and self.stage_age is not None and self.stage_age[row][column] + 1 < self.refinement:
            return {code: 1.0}
        if code == 15:
            return {0: 1.0}
        if code >= 11:
            return {code + 1: 1.0}
        if code == 0:
            fertile = self.cover[row][column] in (WETLAND, GRASSLAND, FOREST) and not self.firebreak[row][column]
            regrows = self.in_a_tick(self.p_regrow) if fertile else 0.0
            return {0: 1.0 - regrows, 1: regrows}
        ignites = self.chance_to_ignite(row, column)
        if not self.growth or code >= self.oldest:
            return {11: ignites, code: 1.0 - ignites}
        grows = (1.0 - ignites) * self.in_a_tick(math.exp(-code / self.oldest * 5.0))
        return {11: ignites, code + 1: grows, code: 1.0 - ignites - grows}


@cache
def fbp_factor(speed: float, angle: float, ratio: float, eccentricity: float, parts: int = 2_000) -> float:
    """Return w_d of kernel ``fbp`` for C-7 at FFMC 94, its means by sums over small parts of 45 degrees."""

    def mean(about: float, power: int) -> float:
        turns = (about + ((part + 0.5) / parts - 0.5) * math.pi / 4 for part in range(parts))
        return sum((1.0 - eccentricity * math.cos(turn)) ** -power for turn in turns) / parts

    moisture = 147.2 * (101 - 94) / (59.5 + 94)
    fine = 91.9 * math.exp(-0.1386 * moisture) * (1.0 + moisture**5.31 / 4.93e7)
    kmh = 3.6 * speed
    effect = math.exp(0.05039 * kmh) if kmh <= 40.0 else 12.0 * (1.0 - math.exp(-0.0818 * (kmh - 28.0)))
    head = (1.0 - math.exp(-0.0305 * 0.208 * fine * effect)) / (1.0 - math.exp(-0.0305 * 0.208 * fine))
    first, second = (mean(angle, power) / mean(0.0, power) for power in (1, 2))
    share = eccentricity**2
    return head**2 * (1.0 + 3.2 * (1.0 - 1.0 / ratio)) * ((1.0 - share) * first + share * second)
