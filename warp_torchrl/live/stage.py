"""One side of a match in viser's scene; only changes are sent."""

from typing import Any, Protocol

import numpy as np
import torch
import viser
from torch import Tensor

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.render import painted
from warp_torchrl.env.pictures.veil import View, seen_as
from warp_torchrl.live import drawing
from warp_torchrl.live.crew import Crew
from warp_torchrl.live.drawing import Instances
from warp_torchrl.live.ground import SceneGround, ground_of
from warp_torchrl.live.shapes import TILE, Mesh, bulldozer, drone, flame, house, puff, tree
from warp_torchrl.live.words import labels
from warp_torchrl.world.state.role import ROLES
from warp_torchrl.world.state.state import WorldState

_EARTH, _IRON, _WIND, _GLOW = (84, 66, 52), (38, 40, 44), (196, 214, 240), (255, 128, 40)


class Flock:
    """Copies of a shape whose number changes: it grows by doubling, and those not needed have no size.

    Args:
        server: Where they are drawn.
        name: Of the node.
        shape: Of each.
        opacity: In 0..1; None is opaque.
    """

    def __init__(self, server: viser.ViserServer, name: str, shape: Mesh, opacity: float | None = None) -> None:
        self._server, self._name, self._shape, self._opacity = server, name, shape, opacity
        self._handle: Any = None
        self._room = 0

    def show(self, copies: Instances) -> None:
        """Draw these."""
        count = len(copies.position)
        if self._handle is None or count > self._room:
            self._room = max(16, 1 << (count - 1).bit_length()) if count else 16
        spare = self._room - count
        position = np.pad(copies.position, ((0, spare), (0, 0)))
        scale = np.pad(copies.scale, ((0, spare), (0, 0)), constant_values=1e-5)
        turn = np.pad(copies.turn, ((0, spare), (0, 0)))
        turn[count:, 0] = 1.0
        colour = np.pad(_light(copies.colour), ((0, spare), (0, 0)))
        if self._handle is None or len(self._handle.batched_positions) != self._room:
            self._handle = self._server.scene.add_batched_meshes_simple(
                self._name, *self._shape, turn, position, batched_scales=scale, batched_colors=colour,
                opacity=self._opacity, flat_shading=True, lod="off", cast_shadow=False, receive_shadow=False,
            )  # fmt: skip
            return
        change(self._handle, batched_positions=position, batched_scales=scale, batched_colors=colour)


class Shown(Protocol):
    """What a stage reads of a side; its tensors are on the CPU."""

    @property
    def env(self) -> WildfireEnv:
        """Return the environment, which has the team and its names."""
        ...

    @property
    def crew(self) -> Crew:
        """Return the crew, which controls the vehicles."""
        ...

    @property
    def state(self) -> WorldState:
        """Return the state of the world, batch size [1]."""
        ...

    facing: Tensor
    """Direction of each vehicle, int64 [A]: 0..7 clockwise from north; -1 before its first move."""


class Stage:
    """One side's part of the scene.

    Args:
        server: Where it is drawn.
        index: Of the side; its nodes stand under ``/side_<index>``.
        side: The side, at the start of an episode.
        east: By how much its middle is east of the scene's [cells].
    """

    def __init__(self, server: viser.ViserServer, index: int, side: Shown, east: float) -> None:
        self._server, self._side, self._root = server, side, f"/side_{index}"
        self._called = labels(side.env.agent_names)
        self.east = east
        self.ground: SceneGround = ground_of(side.state)
        scene, ground = server.scene, self.ground
        scene.add_frame(self._root, show_axes=False, position=(east, 0.0, 0.0))
        scene.add_mesh_simple(
            self._node("block"), *ground.block, color=_EARTH, flat_shading=True, side="double", cast_shadow=False
        )
        self.tiles = scene.add_batched_meshes_simple(
            self._node("tiles"), *TILE, ground.turn, ground.position, batched_scales=ground.side,
            batched_colors=np.zeros((len(ground.position), 3), np.uint8), side="double", lod="off", cast_shadow=False,
            receive_shadow=False,
        )  # fmt: skip
        self._trees = Flock(server, self._node("trees"), tree())
        self._flames = Flock(server, self._node("flames"), flame())
        self._smoke = Flock(server, self._node("smoke"), puff(), 0.24)
        self._houses = Flock(server, self._node("houses"), house())
        self._flies = side.env.world.team.table(torch.device("cpu")).flies
        self._add_vehicles()
        self._wind = scene.add_arrows(
            self._node("wind"), drawing.wind_arrows(side.state, ground), _WIND, **_arrow(max(ground.size) / 520.0)
        )
        self._glow = scene.add_light_point(self._node("glow"), color=_GLOW, intensity=0.0, distance=26.0, decay=1.4)
        self._title = scene.add_label(
            self._node("title"), "", position=(0.0, ground.size[0] / 2.0 + 1.0, float(ground.height.max()) + 4.0),
            anchor="bottom-center", font_screen_scale=1.15,
        )  # fmt: skip
        self.show("")

    def show(self, title: str, view: View = "truth") -> None:
        """Draw the present state of the side as a view shows it, under a title; vehicles are where they are."""
        ground = self.ground
        state, colours = seen_as(self._side.state[:1], self._side.env.world, view)
        cells = painted(colours, state, None, 1)[0]
        with self._server.atomic():
            change(self.tiles, batched_colors=_light(drawing.tiles(state, ground, cells)))
            if len(ground.trees):
                self._trees.show(drawing.trees(state, ground, cells))
            self._flames.show(drawing.flames(state, ground))
            self._smoke.show(drawing.smoke_puffs(state, ground))
            self._show_sparks(state)
            buildings = self._side.env.world.buildings(self._side.state)
            if buildings is not None:
                self._houses.show(drawing.houses(buildings, ground))
            self._show_vehicles()
            place, strength = drawing.glow(state, ground)
            change(self._glow, position=place, intensity=strength)
            change(self._wind, points=drawing.wind_arrows(state, ground))
            change(self._title, text=title)

    def remove(self) -> None:
        """Take the side away."""
        self._server.scene.remove_by_name(self._root)

    def _show_sparks(self, state: WorldState) -> None:
        place, colour = drawing.sparks(state, self.ground)
        self._server.scene.add_point_cloud(  # anew: places and colours change together
            self._node("sparks"), place, colour, point_size=0.09, point_shape="circle", point_shading="flat"
        )

    def _node(self, name: str) -> str:
        return f"{self._root}/{name}"

    def _vehicles(self) -> Instances:
        return drawing.vehicles(self._side.state, self.ground, self._flies, self._side.facing)

    def _add_vehicles(self) -> None:
        scene, shown = self._server.scene, self._vehicles()
        self._bodies: list[tuple[np.ndarray, Any]] = []
        for role in dict.fromkeys(self._side.env.world.team.agent_roles):
            own = np.array([each == role for each in self._side.env.world.team.agent_roles])
            for part, shape in (drone() if ROLES[role].flies else bulldozer()).items():
                colour = shown.colour[own] if part == "body" else np.array(_IRON)
                handle = scene.add_batched_meshes_simple(
                    self._node(f"{role}_{part}"), *shape, shown.turn[own], shown.position[own],
                    batched_scales=shown.scale[own], batched_colors=_light(colour),
                    flat_shading=True, lod="off", cast_shadow=False, receive_shadow=False,
                )  # fmt: skip
                self._bodies.append((own, handle))
        size = float(shown.scale[0, 0])
        self._headings = scene.add_arrows(
            self._node("headings"), drawing.headings(shown, {}, self.ground), shown.colour, **_arrow(size / 9.0)
        )
        self._names = [
            scene.add_label(self._node(f"name_{name}"), called, anchor="bottom-center", font_screen_scale=0.72)
            for name, called in zip(self._side.env.agent_names, self._called)
        ]
        self._lift = np.array([0.0, 0.0, 1.3 * size])

    def _show_vehicles(self) -> None:
        side = self._side
        shown = self._vehicles()
        for own, handle in self._bodies:
            change(handle, batched_positions=shown.position[own], batched_wxyzs=shown.turn[own])
        orders = {agent: seat.order for agent, seat in enumerate(side.crew.seats) if seat.order is not None}
        goals = {agent: (order.row, order.column) for agent, order in orders.items()}
        change(self._headings, points=drawing.headings(shown, goals, self.ground))
        tank, full = side.state.vehicles.tank[0].tolist(), side.env.world.team.tank
        for agent, (label, name) in enumerate(zip(self._names, self._called)):
            water = "" if full is None else f" {tank[agent]}/{full}"
            driven = " driven" if side.crew.seats[agent].person is not None else ""
            change(label, text=f"{name}{water}{driven}", position=shown.position[agent] + self._lift)


def change(handle: Any, **values: Any) -> None:
    """Set properties of a node or control, and send only the values that differ."""
    for name, value in values.items():
        if not np.array_equal(getattr(handle, name), value):
            setattr(handle, name, value)


def _light(colour: np.ndarray) -> np.ndarray:
    """Return colours of a screen (sRGB) as amounts of light, which viser takes for copies of a mesh; uint8 [..., 3]."""
    share = np.arange(256) / 255.0
    table = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return (table * 255.0).round().astype(np.uint8)[colour]


def _arrow(radius: float) -> dict[str, float]:
    return {"shaft_radius": radius, "head_radius": 2.6 * radius, "head_length": 5.0 * radius}
