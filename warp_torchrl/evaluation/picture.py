"""An episode as a file: a GIF, an MP4, or an HTML document that plays in a browser."""

from collections.abc import Sequence
from fractions import Fraction
from pathlib import Path
from typing import Literal, get_args

from PIL import Image
from tensordict.nn import TensorDictModuleBase

from warp_torchrl.env import WildfireEnv
from warp_torchrl.env.pictures.recorder import EpisodeRecorder
from warp_torchrl.evaluation.play import play
from warp_torchrl.system import disk

PictureKind = Literal["gif", "html", "mp4"]
"""As what an episode can be written; ``html`` needs the extra ``live``, ``mp4`` the extra ``video``."""
_WHOLE = {"movflags": "+faststart"}  # a browser plays it before all of it is there
PICTURE_KINDS: tuple[PictureKind, ...] = get_args(PictureKind)


def record_episode(
    path: Path, kind: PictureKind, env: WildfireEnv, policy: TensorDictModuleBase, title: str, seed: int, mode: str
) -> None:
    """Play one episode in an environment of one world, and write it; all kinds show the same one.

    Args:
        path: The file; it appears whole or not at all.
        kind: As what it is written.
        env: Of one world.
        policy: Any policy.
        title: Heading; what follows a line break stands smaller below it.
        seed: Of the world, and of the draws of a sampled policy.
        mode: ``sampled`` or ``deterministic``.
    """
    if kind == "html":
        from warp_torchrl.live.episode import SceneRecorder  # the extra live

        scene = SceneRecorder(title, env)
        play(env, policy, seed, mode, scene)
        scene.save(path)
        return
    frames = EpisodeRecorder(title, env.world.team.agent_roles, env.world.buildings)
    play(env, policy, seed, mode, frames)
    if kind == "mp4":
        write_video(path, frames.frames())
    else:
        frames.save(path)


def write_video(path: Path, frames: Sequence[tuple[Image.Image, int]]) -> None:
    """Write pictures as an MP4 (H.264), at twice their size; the file appears whole or not at all.

    Args:
        path: The file.
        frames: Pictures, all of one size, each with its duration, a multiple of the first one's [ms].
    """
    import av  # the extra video

    tact = frames[0][1]
    with disk.drafted(path) as draft, av.open(str(draft), "w", format="mp4", options=_WHOLE) as film:
        stream = film.add_stream("libx264", rate=Fraction(1000, tact), options={"crf": "20"})
        stream.width, stream.height = (2 * side for side in frames[0][0].size)  # even, as players want them
        stream.pix_fmt = "yuv420p"  # browsers show no other
        for picture, duration in frames:
            large = picture.convert("RGB").resize((stream.width, stream.height), Image.Resampling.NEAREST)
            for _ in range(max(1, duration // tact)):
                film.mux(stream.encode(av.VideoFrame.from_image(large)))
        film.mux(stream.encode())
