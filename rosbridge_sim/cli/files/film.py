"""`shot --scenario` and `clip`: pictures of a scenario or a recording that is driven here, without a server."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rosbridge_sim.cli.tools.picture_files import picture_of, save
from rosbridge_sim.cli.tools.text import note, put, put_json, put_progress
from rosbridge_sim.errors import SettingError
from rosbridge_sim.link.terminal_text import safe
from rosbridge_sim.shell.config.loading import read_world
from rosbridge_sim.shell.scene_film import FilmCamera, SceneFilm

if TYPE_CHECKING:  # it is imported late, because few commands need it
    from PIL.Image import Image

FRAMES_A_SECOND: Final = 50

MOVING: Final = (".webp", ".gif", ".png")
"""Suffixes of files that hold moving pictures; a moving PNG is an APNG."""

STILL: Final = (*MOVING, ".jpg", ".jpeg")

MAX_CLIP_PIXELS: Final = 150_000_000
"""Pixels of a clip, all its pictures together: Pillow keeps them until the end, 600 MB."""

_ENCODINGS: Final = {"rgb": "rgb8", "depth": "32FC1", "semantic": "mono8", "instance": "mono16"}
"""Picture of a camera -> encoding of its bytes."""


@dataclass(frozen=True, slots=True)
class FilmChoice:
    """A scene and a camera, as the user chose them.

    Attributes:
        words: flags of the world, as of a server.
        camera: name of the camera.
        size: of the pictures; None for that of the camera.
        ego: number of the ego.
        recording: bag that moves the world; None for none.
        is_driving: the ego drives itself.
        at: simulated time of the first picture [s].
        out: the file.
        quality: of WebP and JPEG, 1..100.
        is_json: print what was written as JSON.
    """

    words: Sequence[str]
    camera: str
    size: tuple[int, int] | None
    ego: int
    recording: Path | None
    is_driving: bool
    at: float
    out: Path
    quality: int
    is_json: bool


def film_shot(choice: FilmChoice) -> None:
    """Save one picture.

    Args:
        choice: scene, camera and file.

    Raises:
        DocumentError: the scene or the camera cannot be used, nothing can be drawn here, or the file cannot be written.
    """
    _check_suffix(choice.out, STILL)
    (picture,) = _film(choice, [round(choice.at * FRAMES_A_SECOND)])
    num_bytes = save(choice.out, lambda: picture.save(choice.out, quality=choice.quality))
    _tell(choice, picture, num_bytes, 1)


def film_clip(choice: FilmChoice, seconds: float, rate: float) -> None:
    """Save a moving picture, which begins again at its end.

    Args:
        choice: scene, camera and file.
        seconds: simulated time that it shows.
        rate: pictures a second; each shows the last frame of its moment, so their times may differ by 20 ms.

    Raises:
        DocumentError: as for `film_shot`.
        SettingError: there would be too many pixels.
    """
    _check_suffix(choice.out, MOVING)
    first = round(choice.at * FRAMES_A_SECOND)
    num = max(1, round(seconds * rate))
    frames = [first + int(i * FRAMES_A_SECOND / rate) for i in range(num + 1)]  # the last one is the end
    pictures = _film(choice, frames[:-1])
    if len(pictures) < num:
        note(f"the recording is over: {len(pictures)} of {num} pictures")
    times = [20 * (after - before) for before, after in pairwise(frames)][: len(pictures)]
    num_bytes = save(
        choice.out,
        lambda: pictures[0].save(
            choice.out,
            save_all=True,
            append_images=pictures[1:],
            duration=times,
            loop=0,
            quality=choice.quality,
            method=6,  # of WebP: the smallest file
        ),
    )
    _tell(choice, pictures[0], num_bytes, len(pictures))


def _check_suffix(path: Path, suffixes: Sequence[str]) -> None:
    if path.suffix.lower() not in suffixes:
        raise SettingError(f"--out: expected a file that ends with {', '.join(suffixes)}; got {path.name!r}")


def _film(choice: FilmChoice, frames: Sequence[int]) -> list[Image]:
    """Return a picture of each frame; fewer if a recording is over before, but at least one."""
    settings = read_world(choice.words)
    camera = FilmCamera(choice.camera, settings.sensors, choice.size)
    width, height = camera.size
    num_pixels = width * height * len(frames)
    if num_pixels > MAX_CLIP_PIXELS:
        raise SettingError(
            f"expected at most {MAX_CLIP_PIXELS:,} pixels in all pictures together; {len(frames)} of {width} x {height}"
            f" are {num_pixels:,}: choose a smaller --size, --fps or --seconds"
        )
    if len(frames) > 1 and camera.spec.picture != "rgb":
        raise SettingError(f"--camera: a clip needs a camera of colours; {choice.camera} shows {camera.spec.picture}")
    film = SceneFilm(settings, camera, ego=choice.ego, recording=choice.recording, is_driving=choice.is_driving)
    pictures = []
    try:
        for i, frame in enumerate(frames):
            if not film.advance(frame) and i:
                break
            pictures.append(picture_of(film.shoot(), camera.size, _ENCODINGS[camera.spec.picture]))
            put_progress(f"{i + 1} of {len(frames)} pictures")
    finally:
        put_progress("")
        film.close()
    return pictures


def _tell(choice: FilmChoice, picture: Image, num_bytes: int, num: int) -> None:
    width, height = picture.size
    path = str(choice.out)
    if choice.is_json:
        put_json({"file": path, "width": width, "height": height, "pictures": num, "bytes": num_bytes})
    else:
        many = f"  {num} pictures" if num > 1 else ""
        put(f"{safe(path)}  {width} x {height}{many}  {num_bytes:,} bytes  {safe(choice.camera)}")
