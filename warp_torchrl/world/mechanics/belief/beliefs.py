"""Planes of beliefs in the worlds, and what readers make of them.

B worlds, G beliefs to a world (the team's, or one of each agent), K members to a belief, M hidden fires to a world.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from warp_torchrl.world.arrays.batch import Batch, Named
from warp_torchrl.world.arrays.blocks import sums_about
from warp_torchrl.world.ensemble.members import rows_of
from warp_torchrl.world.mechanics.belief.learning import OF_WORLD, Learning
from warp_torchrl.world.state.cells import is_burning, is_tree
from warp_torchrl.world.state.state import FIRST_FIRE, WorldState

NAME = "belief"
"""Of the planes in the state."""
BLUR = 4
"""Over which the chance of hidden fires is spread, by Chebyshev distance [cells]."""


@dataclass(eq=False, repr=False)
class Beliefs(Batch):
    """What teams believe of the fire."""

    members: Named  # [B,G*K,...], imagined worlds, see ``world.ensemble.members``
    weights: Tensor  # float32 [B,G,K], of the members; their sum is 1
    learning: Learning | None  # what is known of wind and rate; None where all of it is
    chances: Named  # ``values`` float32 [B,G*K,H,W], of trees to have ignited in the last tick; empty without weights
    hidden: Named  # [B,M,...], single fires that may be anywhere, as they would have grown by now; or empty
    possible: Tensor  # float32 [B,G,M], how likely each of them still is to be a fire that nobody saw, 0..1
    found: Tensor  # float32 [B,G,M], how likely each of them was when it turned out to be the fire that is known
    lit: Tensor  # bool [B,G,H,W], where fire was seen so far
    fires: Tensor  # int32 [B,G], that were found so far
    unseen: Tensor  # float32 [B,G,H,W], chance of each cell to burn by a fire that nobody saw
    soon: Tensor  # float32 [B,G,H,W], chance of each cell to burn soon, as it was after the last tick, see ``soon``
    overlap: Tensor  # int32 [B], sum over steps of cells that burn and are believed to
    union: Tensor  # int32 [B], sum over steps of cells that burn or are believed to
    skill: Tensor  # float32 [B], Brier skill score of the members now, see ``brier_skill``
    skills: Tensor  # float32 [B], sum of it over the steps in which something burns
    alight: Tensor  # int32 [B], steps in which something burns


def beliefs_of(state: WorldState) -> Beliefs:
    """Return the beliefs.

    Raises:
        ValueError: If there are none.
    """
    return state.planes(NAME, Beliefs)


def cells_of(beliefs: Beliefs) -> Tensor:
    """Return the members' codes, uint8 [B, G, K, H, W]."""
    codes: Tensor = beliefs.members.held["cells"]
    return codes.unflatten(1, beliefs.weights.shape[1:])


def mean_of(beliefs: Beliefs, planes: Tensor) -> Tensor:
    """Return the weighted mean of the members' planes, bool [B, G, K, H, W], float32 [B, G, H, W].

    They are added one after the other, so that the sum is the same in any batch.
    """
    total = torch.zeros_like(planes[:, :, 0], dtype=torch.float32)
    for member in range(planes.shape[2]):  # each is whole planes of all worlds
        total = total + planes[:, :, member] * beliefs.weights[:, :, member, None, None]
    return total


def known_probability(beliefs: Beliefs) -> Tensor:
    """Return the chance of each cell to burn by the fires that are known, float32 [B, G, H, W]."""
    return mean_of(beliefs, is_burning(cells_of(beliefs)))


def disagreement(beliefs: Beliefs) -> Tensor:
    """Return how much the members disagree on each cell, 4 p (1 - p), float32 [B, G, H, W] in 0..1."""
    p = known_probability(beliefs)
    return 4.0 * p * (1.0 - p)


def hidden_probability(beliefs: Beliefs, fires: int) -> Tensor:
    """Return the chance of each cell to burn by a fire that nobody saw, float32 [B, G, H, W].

        p = (1 - o) ((1 - g)^m - (1 - g - h)^m)

    Of the hidden fires, by how likely they are, the share h burns in a cell, and the share g has burned out there. The
    first of several fires to arrive counts. h and g are means over the cells within ``BLUR``: fires of one place
    differ, and M of them leave gaps. m is the number of fires that were lit and not found. o is the share of the
    members in which the cell has burned out.

    Args:
        beliefs: What is believed.
        fires: That were lit.
    """
    if not beliefs.hidden.held:
        return torch.zeros_like(known_probability(beliefs))
    cells, burned = (beliefs.hidden.held[name] for name in ("cells", "burned"))
    share = beliefs.possible / (beliefs.possible + beliefs.found).sum(dim=2, keepdim=True).clamp(min=1e-6)
    burns, gone = (_spread(share, each) for each in (is_burning(cells), _is_ash(cells, burned)))
    left = (fires - beliefs.fires).clamp(min=0)[..., None, None]
    first = (1.0 - gone).clamp(min=0.0).pow(left) - (1.0 - gone - burns).clamp(min=0.0).pow(left)
    known = beliefs.members.held["burned"].unflatten(1, beliefs.weights.shape[1:])
    return first * (1.0 - mean_of(beliefs, _is_ash(cells_of(beliefs), known)))


def _is_ash(cells: Tensor, burned: Tensor) -> Tensor:
    """Return which cells have burned out and hold no tree since."""
    return burned & (cells == 0)


def _spread(share: Tensor, planes: Tensor) -> Tensor:
    """Return the sum of planes, bool [B, M, H, W], by shares, [B, G, M], as means over near cells, [B, G, H, W]."""
    total = torch.bmm(share, planes.flatten(2).to(torch.float32)).unflatten(2, planes.shape[2:])
    return sums_about(total, BLUR) / sums_about(torch.ones_like(total[:1, :1]), BLUR)


def hidden_fire(beliefs: Beliefs) -> Tensor:
    """Return the square root of the chance of each cell to burn by a fire that nobody saw, float32 [B, G, H, W].

    The root lets whole numbers tell small chances apart.
    """
    return beliefs.unseen.sqrt()


def burn_soon(beliefs: Beliefs) -> Tensor:
    """Return the chance of each cell to burn soon, float32 [B, G, H, W]."""
    return beliefs.soon


def most_believed(state: WorldState, threshold: float) -> WorldState:
    """Return the worlds as they are believed to be, batch size [B * G].

    A cell burns if it burns in members of more weight than ``threshold``. It is empty if it is empty in members of more
    than half of the weight. The code is the heaviest member's where it agrees. All else of the fire is its own.
    """
    beliefs = beliefs_of(state)
    codes = cells_of(beliefs)
    heaviest = beliefs.weights.argmax(dim=2, keepdim=True)

    def of_heaviest(leaf: Tensor) -> Tensor:
        each = leaf.unflatten(1, codes.shape[1:3])
        index = heaviest.view(*heaviest.shape, *[1] * (each.ndim - 3)).expand(-1, -1, 1, *each.shape[3:])
        return each.gather(2, index)[:, :, 0]

    held = beliefs.members.held.items()
    first = {name: of_heaviest(leaf) for name, leaf in held if name != "key"}
    code, says = first["cells"], is_burning(first["cells"])
    burns, gone = known_probability(beliefs) > threshold, mean_of(beliefs, codes == 0) > 0.5
    tree = torch.where(is_tree(code), code, state.landscape.age[:, None])
    cells = torch.where(burns, torch.where(says, code, FIRST_FIRE + 1), torch.where(gone, 0, tree))
    first["age"] = torch.where(burns, torch.where(says, first["age"], tree), 0)
    first["cells"] = cells.to(torch.uint8)
    own, groups = state, codes.shape[1]
    if groups > 1:
        own = state.without_planes(NAME)[rows_of(state, groups)].with_planes(NAME, each_alone(beliefs))
    return own.with_leaves({**own.leaves(), **{name: leaf.flatten(0, 1) for name, leaf in first.items()}})


def each_alone(beliefs: Beliefs) -> Beliefs:
    """Return each belief of B worlds as the one of a world, batch size [B * G]."""
    groups, known = beliefs.weights.shape[1], beliefs.learning

    def parted(leaf: Tensor) -> Tensor:
        return leaf.flatten(0, 1)[:, None]

    def repeated(leaf: Tensor) -> Tensor:
        return leaf.repeat_interleave(groups, dim=0)

    def members(kept: Named) -> Named:
        return Named({name: leaf.unflatten(1, (groups, -1)).flatten(0, 1) for name, leaf in kept.held.items()})

    return Beliefs(
        members=members(beliefs.members),
        weights=parted(beliefs.weights),
        learning=None
        if known is None
        else known.with_leaves(
            {name: (repeated if name in OF_WORLD else parted)(leaf) for name, leaf in known.leaves().items()}
        ),
        chances=members(beliefs.chances),
        hidden=Named({name: repeated(leaf) for name, leaf in beliefs.hidden.held.items()}),
        possible=parted(beliefs.possible),
        found=parted(beliefs.found),
        lit=parted(beliefs.lit),
        fires=parted(beliefs.fires),
        unseen=parted(beliefs.unseen),
        soon=parted(beliefs.soon),
        overlap=repeated(beliefs.overlap),
        union=repeated(beliefs.union),
        skill=repeated(beliefs.skill),
        skills=repeated(beliefs.skills),
        alight=repeated(beliefs.alight),
    )
