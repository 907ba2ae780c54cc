"""Pictures: what a reader sees of a cell, and of an agent."""

import pytest
import torch

from tests.env.pictures.worlds import drawn, small_world
from tests.world.drawing import knowing
from warp_torchrl.env.pictures.colours import HOUSE, LOST, PAPER
from warp_torchrl.env.pictures.render import render
from warp_torchrl.world.arrays.batch import concatenated
from warp_torchrl.world.state.state import Cover, WorldState

UGV, UAV = torch.tensor([0]), torch.tensor([1])


def colours(state: WorldState) -> torch.Tensor:
    """Return the colour of each cell of the first world, int64 [H, W, 3]."""
    return render(state, None, scale=1)[0].to(torch.int64)


def lightness(colour: torch.Tensor) -> torch.Tensor:
    """Return the luminance of sRGB colours, 0..1."""
    linear = (colour / 255.0) ** 2.2
    return linear @ torch.tensor([0.2126, 0.7152, 0.0722])


@pytest.mark.parametrize("size", [(8, 8), (5, 11), (13, 4)])
@pytest.mark.parametrize("scale", [1, 4, 12])
def test_a_frame_has_scale_pixels_to_a_cell(size, scale):
    team, state = small_world(size, worlds=3)
    frames = render(state, team.table(state.cells.device).index, scale)
    assert frames.shape == (3, size[0] * scale, size[1] * scale, 3)
    assert frames.dtype == torch.uint8


def test_a_house_is_a_square_in_an_outline_light_while_it_stands():
    left = torch.tensor([[[-1.0, 1.0], [0.4, -1.0]], [[-1.0, -1.0], [-1.0, 0.5]]])
    state = drawn([[5, 5], [5, 5]])
    image = render(concatenated([state, state]), None, 4, left)
    plain = render(state, None, 4)[0]
    assert torch.equal(image[0, :4, :4], plain[:4, :4]) and torch.equal(image[0, 4:, 4:], plain[4:, 4:])
    assert (image[0, 1:3, 5:7] == torch.tensor(HOUSE)).all() and (image[0, 5:7, 1:3] == torch.tensor(LOST)).all()
    assert (image[0, 0, 4:] == torch.tensor(PAPER)).all() and (image[1, 5:7, 5:7] == torch.tensor(HOUSE)).all()
    assert torch.equal(image[1, :, :4], plain[:, :4])


def test_a_batch_is_drawn_as_its_worlds_are():
    team, state = small_world(n_agents=5, worlds=4)
    roles = team.table(state.cells.device).index
    alone = torch.cat([render(state[index : index + 1], roles) for index in range(4)])
    assert torch.equal(render(state, roles), alone)


def test_a_scale_below_one_is_refused():
    with pytest.raises(ValueError, match="scale must be at least 1 pixel, got 0"):
        render(small_world()[1], None, scale=0)


def test_every_kind_of_cell_has_its_own_colour():
    ages = list(range(11))
    covers = [[cover] * 11 for cover in (Cover.WETLAND, Cover.GRASSLAND, Cover.FOREST)]
    trees = colours(drawn([ages] * 3, covers)).reshape(-1, 3)
    wet = colours(drawn([ages] * 3, covers, wet=[[3] * 11] * 3)).reshape(-1, 3)
    fire = colours(drawn([[11, 12, 13, 14, 15]]))[0]
    bare = colours(drawn([[0, 0]], [[Cover.LAKE, Cover.BARE]]))[0]
    ash_and_break = colours(drawn([[0, 0]], burned=[[True, False]], firebreak=[[False, True]]))[0]
    kinds = torch.cat((trees, wet, fire, bare, ash_and_break))
    assert len(kinds.unique(dim=0)) == len(kinds) == 33 + 33 + 5 + 2 + 2


def test_what_nobody_saw_lately_is_in_fog():
    state = drawn([[6, 12, 6, 12, 6]])
    plain = colours(state)[0]
    record = torch.tensor([[[[18, 1, 18, 1, 0]], [[1, 1, 1, 18, 0]]]], dtype=torch.int32) * 64
    state = knowing(state, record).replace(step=torch.full_like(state.step, 17))  # seen now, or 17 steps ago
    fog = colours(state)[0]
    assert [torch.equal(ours, theirs) for ours, theirs in zip(fog, plain)] == [True, False, True, True, False]
    assert (fog[1].int() < plain[1].int()).all() and (fog[4].int() < plain[4].int()).all()
    assert not torch.equal(fog[1], fog[4]), "fire is seen through it"
    earlier = colours(state.replace(step=torch.full_like(state.step, 16)))[0]
    assert torch.equal(earlier[1], plain[1]) and not torch.equal(earlier[4], plain[4])


def test_marks_are_drawn_where_they_are():
    # forest of age 6; burnt, cleared, wet and burning cells on the diagonal
    cells = [[0, 6, 6, 6], [6, 0, 6, 6], [6, 6, 6, 6], [6, 6, 6, 12]]
    mark = torch.eye(4, dtype=torch.bool)
    only = [
        torch.zeros(4, 4, dtype=torch.bool).index_put((torch.tensor(i), torch.tensor(i)), mark[i, i]) for i in range(3)
    ]
    image = colours(drawn(cells, burned=only[0].tolist(), firebreak=only[1].tolist(), wet=(only[2] * 4).tolist()))
    forest = image[0, 1]
    assert (image[~mark] == forest).all()
    ash, firebreak, wet, fire = image.diagonal(dim1=0, dim2=1).T
    assert ash.max() < 60  # dark
    assert ash.max() - ash.min() < 10  # and grey
    assert firebreak[0] > firebreak[1] > firebreak[2] > 128  # tan
    assert wet[2] > forest[2] + 50  # bluer
    assert fire[0] > 200 > fire[2] + 100  # red without blue


def test_a_tree_that_regrew_on_ash_looks_like_a_tree():
    assert torch.equal(colours(drawn([[4]], burned=[[True]])), colours(drawn([[4]])))


def test_fire_is_not_tinted_by_water():
    assert torch.equal(colours(drawn([[13]], wet=[[2]])), colours(drawn([[13]])))


def test_the_fire_front_is_lighter_than_any_ground():
    ages = list(range(11))
    ground = colours(drawn([ages] * 5, [[cover] * 11 for cover in Cover]))
    assert lightness(colours(drawn([[11, 12, 13]]))).min() > lightness(ground).max() * 1.15


def test_older_trees_are_darker_and_fire_dims_as_it_ages():
    trees = lightness(colours(drawn([list(range(11))]))[0])
    fire = lightness(colours(drawn([[11, 12, 13, 14, 15]]))[0])
    assert (trees.diff() < 0).all()
    assert (fire.diff() < 0).all()


@pytest.mark.parametrize(("roles", "body"), [(UGV, (124, 30, 190)), (UAV, (90, 236, 255))])
def test_an_agent_is_seen_in_its_cell(roles, body):
    state = drawn([[5] * 5] * 5, at=((1, 3),))
    changed = (render(state, roles, 10) != render(state, None, 10)).any(dim=-1)[0]
    assert render(state, roles, 10)[0, 15, 35].tolist() == list(body)
    assert changed[10:20, 30:40].float().mean() > 0.5
    rows, columns = changed.nonzero().unbind(1)  # and hides no neighbour's middle
    assert (rows.min() > 5, rows.max() < 25, columns.min() > 25, columns.max() < 45) == (True,) * 4


def test_agents_stay_visible_where_cells_are_small():
    state = drawn([[5] * 30] * 30, at=((15, 15),))
    assert (render(state, UGV, 1) != render(state, None, 1)).any(dim=-1).sum() > 40


@pytest.mark.parametrize("place", [(0, 0), (0, 4), (2, 0), (2, 4)])
@pytest.mark.parametrize("roles", [UGV, UAV])
def test_an_agent_in_a_corner_is_cut_at_the_edge(place, roles):
    state = drawn([[5] * 5] * 3, at=(place,))
    changed = (render(state, roles) != render(state, None)).any(dim=-1)[0]
    assert changed[12 * place[0] + 6, 12 * place[1] + 6]
    assert not changed[12 * (2 - place[0]) + 6, 12 * (4 - place[1]) + 6]  # nothing wraps round


def test_aircraft_are_drawn_over_ground_vehicles():
    state = drawn([[5] * 3] * 3, at=((1, 1), (1, 1)))
    for roles in (torch.tensor([0, 1]), torch.tensor([1, 0])):
        assert render(state, roles)[0, 18, 18].tolist() == [90, 236, 255]
