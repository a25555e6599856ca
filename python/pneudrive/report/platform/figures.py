"""A platform on legs as a picture and as an animation of a run, from the scene that SVG text and the page show."""

from __future__ import annotations

import shutil
from contextlib import suppress
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import CommandError
from pneudrive.report import style
from pneudrive.report.platform.scene import FONT, INKS, LOOKS, platform_scene
from pneudrive.report.written import PICTURES, drawn
from pneudrive.simulation.trajectory import check_target, whole

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike, NDArray
    from PIL import Image

    from pneudrive.platforms.kinematics import Platform
    from pneudrive.report.platform.scene import PlatformScene

    Array = NDArray[np.float64]

#: Pixels of a scene in an inch, and dots of an animation in an inch.
PX_IN, FILM_DPI = 100.0, 150.0
#: Colours of a GIF: two inks, and their mixtures with the paper.
COLOURS = 64
#: Frames in a second. Delays of a GIF are multiples of 10 ms.
FRAMES_S = {".mp4": 30, ".gif": 25}
#: Shortest and longest animation, s. Other runs are shown slower or faster.
SHORTEST_S, LONGEST_S = 2.0, 20.0


def draw_platform(
    platform: Platform, poses: ArrayLike | None = None, path: str | Path | None = None, *, dark: bool = False
) -> Figure:
    """Draw a platform at the last one of some poses, with the path of its origin.

    Parameters
    ----------
    platform : Platform
    poses : array, shape (n,) or (m, n), optional
        Poses of a run, m and rad. By default every leg is at half of its stroke.
    path : path-like, optional
        Picture to write: .svg, .png or .pdf.
    dark : bool
        Draw on dark paper.

    Returns
    -------
    matplotlib.figure.Figure

    Raises
    ------
    CommandError
        Unknown suffix, or the file cannot be written.

    Examples
    --------
    >>> import pneudrive as pn
    >>> tripod = pn.platform(pn.Circuit.load("examples/tripod.toml"))
    >>> figure = pn.report.draw_platform(tripod)
    """
    scene = platform_scene(platform, np.atleast_2d(platform.home if poses is None else platform.pose(poses)))

    def draw() -> Figure:
        figure, axis = _paper(scene, dark=dark)
        put_scene(axis, scene, dark=dark)
        if len(scene.path) > 1:
            ink = INKS["dark" if dark else "light"][0]
            figure.text(0.02, 0.98, "simulated", va="top", fontsize=_points(FONT), color=ink)
        return figure

    return drawn(draw, path, PICTURES)


def animate_platform(
    platform: Platform, time: ArrayLike, poses: ArrayLike, path: str | Path, *, dark: bool = False
) -> Path:
    """Write a run of a platform as a film. The film lasts as long as the run, but at least 2 s and at most 20 s.

    Parameters
    ----------
    platform : Platform
    time : array, shape (m,)
        s, rising.
    poses : array, shape (m, n)
        m and rad.
    path : path-like
        .mp4, which needs the program ffmpeg, or .gif.
    dark : bool
        Draw on dark paper.

    Returns
    -------
    pathlib.Path

    Raises
    ------
    CommandError
        Unknown suffix, ffmpeg is missing, or the file cannot be written.
    """
    target = check_target(path, tuple(FRAMES_S))
    suffix = target.suffix.lower()
    program = shutil.which("ffmpeg")
    if suffix == ".mp4" and program is None:
        remedy = f"Install ffmpeg, or write {target.with_suffix('.gif').name}, which needs no other program."
        raise CommandError(f"{target.name} cannot be written: the program ffmpeg is missing", remedy=remedy)
    time = np.asarray(time, dtype=float)
    lasts = min(max(float(time[-1] - time[0]), SHORTEST_S), LONGEST_S)
    moments = np.linspace(time[0], time[-1], round(lasts * FRAMES_S[suffix]) + 1)
    rows = np.searchsorted(time, moments, side="right") - 1
    scene = platform_scene(platform, np.asarray(poses, dtype=float)[rows])
    from PIL.Image import Dither

    with style.applied(), whole(target) as temporary:
        frames = _frames(scene, moments, dark=dark)
        if program is not None and suffix == ".mp4":
            _write_film(program, frames, temporary)
        else:
            first = next(frames).quantize(COLOURS)
            others = (frame.quantize(palette=first, dither=Dither.NONE) for frame in frames)
            first.save(temporary, save_all=True, append_images=others, duration=1000 // FRAMES_S[suffix], loop=0)
    return target


def _frames(scene: PlatformScene, moments: Array, *, dark: bool) -> Iterator[Image.Image]:
    """Yield a picture of each pose of a scene, with its time, s."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from PIL import Image

    figure, axis = _paper(scene, dark=dark)
    figure.set_dpi(FILM_DPI)
    canvas = FigureCanvasAgg(figure)
    label = axis.text(6.0, 16.0, "", color=INKS["dark" if dark else "light"][0], fontsize=_points(FONT))
    for k, moment in enumerate(moments):
        before = {*axis.lines, *axis.patches, *axis.texts}
        put_scene(axis, scene, k, dark=dark)
        label.set_text(f"{moment:.3f} s, simulated")
        canvas.draw()
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())
        for artist in {*axis.lines, *axis.patches, *axis.texts} - before:
            artist.remove()


def _write_film(program: str, frames: Iterator[Image.Image], target: Path) -> None:
    """Write frames as H.264 through ffmpeg."""
    first = next(frames)
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{first.width}x{first.height}", "-r", str(FRAMES_S[".mp4"])]
    command = [program, "-y", "-loglevel", "error", *given, "-i", "-", "-pix_fmt", "yuv420p", str(target)]
    with TemporaryFile() as said, Popen(command, stdin=PIPE, stdout=DEVNULL, stderr=said) as process:
        assert process.stdin is not None
        with suppress(BrokenPipeError), process.stdin as pipe:
            pipe.write(first.tobytes())
            for frame in frames:
                pipe.write(frame.tobytes())
        if process.wait():
            said.seek(0)
            why = said.read().decode(errors="replace").strip().splitlines()
            raise CommandError(f"ffmpeg did not write the film: {why[-1] if why else 'it stopped'}")


def put_scene(axis: Axes, scene: PlatformScene, row: int = -1, *, dark: bool = False, scale: float = 1.0) -> None:
    """Draw a scene at one of its poses, with the path of all of them.

    Parameters
    ----------
    axis : Axes
        With x and y in pixels of the scene.
    scene : PlatformScene
    row : int
    dark : bool
    scale : float
        Size of the axis relative to that of the scene.
    """
    ink, of_path, _ = INKS["dark" if dark else "light"]
    for what, points in [*scene.lines, ("path", scene.path[None])]:
        look, own = LOOKS[what], points[row if len(points) > 1 else 0]
        if look.fill:
            axis.fill(*own.T, color=ink, alpha=look.fill, lw=0.0)
        width = _points(look.width) * scale
        dashes = (0.0, [part / look.width for part in look.dash]) if look.dash else "-"
        options: dict[str, Any] = {"solid_capstyle": "butt", "linestyle": dashes}
        axis.plot(*own.T, color=of_path if look.is_path else ink, alpha=look.opacity, lw=width, **options)
    for text, (x, y) in scene.labels:
        axis.text(x, y, text, ha="center", va="center", color=ink, fontsize=_points(FONT) * max(scale, 0.6))


def _points(pixels: float) -> float:
    return 72.0 * pixels / PX_IN


def _paper(scene: PlatformScene, *, dark: bool) -> tuple[Figure, Axes]:
    """Return a figure as large as a scene. A film has an even number of pixels."""
    width, height = (4.0 * round(0.25 * size) / PX_IN for size in scene.size)
    figure = style.new_figure(height, width)
    figure.set_layout_engine("none")
    figure.set_facecolor(INKS["dark" if dark else "light"][2])
    axis = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    frame_axis(axis, scene)
    return figure, axis


def frame_axis(axis: Axes, scene: PlatformScene) -> None:
    """Give an axis the pixels of a scene as its coordinates."""
    axis.set_axis_off()
    axis.set_xlim(0.0, scene.size[0])
    axis.set_ylim(scene.size[1], 0.0)
