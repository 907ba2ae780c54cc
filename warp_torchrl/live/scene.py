"""Parts that all scenes share: the server, sky and sun, and the camera."""

import contextlib
import io

import numpy as np
import viser

from warp_torchrl.live.address import Address
from warp_torchrl.live.door import Door

_SKY = np.linspace((13, 19, 33), (52, 50, 62), 64).round().astype(np.uint8)[:, None].repeat(2, axis=1)  # at dusk


class _LocalServer(viser.ViserServer):
    """A server that stays local: viser's would open a public tunnel if a browser sends a request for one."""

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Return None: nothing is shared."""
        return None


def quiet() -> contextlib.AbstractContextManager[object]:
    """Return a context in which viser's own lines are not printed."""
    return contextlib.redirect_stdout(io.StringIO())


def local_server(door: Door | None = None) -> viser.ViserServer:
    """Return a server that shares nothing.

    Args:
        door: Socket and access rule; None refuses all connections.
    """
    if door is None:
        listener, _, access = Address(port=0).listen()
        door = Door(listener, access, lambda connection, message: False)
    with quiet(), door.hung():
        return _LocalServer(verbose=False)


def furnish(server: viser.ViserServer) -> None:
    """Put in what every scene has: a background, sky and sun, and none of viser's own marks."""
    server.gui.configure_theme(control_width="large", dark_mode=True, show_logo=False, show_share_button=False)
    scene = server.scene
    scene.world_axes.visible = False
    scene.set_background_image(_SKY)
    scene.configure_default_lights(enabled=False)
    scene.configure_environment_map(None)  # viser's would come from the network
    scene.add_light_hemisphere("/sky", sky_color=(210, 224, 255), ground_color=(70, 60, 52), intensity=1.8)
    scene.add_light_directional("/sun", color=(255, 226, 196), intensity=3.0, position=(-34.0, -26.0, 50.0))


def map_offsets(columns: int, count: int) -> list[float]:
    """Return by how much each of some maps, side by side, is east of the middle [cells]."""
    apart = columns * 1.14
    return [apart * (index - (count - 1) / 2.0) for index in range(count)]


def aim(server: viser.ViserServer, size: tuple[int, int], count: int, aside: float = 0.0, up: float = 0.0) -> None:
    """Let a browser begin with all maps in its picture, seen from the south.

    Args:
        server: Where they are drawn.
        size: (H, W) of each [cells].
        count: Of the maps, placed as in ``map_offsets``.
        aside: By how much the maps stand left of the middle, as a share of the distance.
        up: By how much they stand below it.
    """
    away = (1.0 + up) * max(1.22 * (1.14 * size[1] * (count - 1) + size[1]), 1.4 * size[0])
    camera = server.initial_camera
    camera.position = (aside * away, -0.8 * away, 0.66 * away)
    camera.look_at = (aside * away, -0.02 * away, up * away)
    camera.fov = 0.8
