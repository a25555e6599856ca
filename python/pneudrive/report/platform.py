"""Pictures of a platform on legs: lines in one projection, picture, film of a run, and page of a run with curves."""

from __future__ import annotations

import shutil
from contextlib import suppress
from dataclasses import replace
from subprocess import DEVNULL, PIPE, Popen
from tempfile import TemporaryFile
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.arrays import Array, Columns, Pair, evenly
from pneudrive.errors import CommandError, package_table
from pneudrive.figures import Axis, Drawing, Figure, Line, Panel, PenStroke, look, thin
from pneudrive.platforms.kinematics import LEAST_SINGULAR_VALUE, Platform, motion_of, platform_outputs, pose_columns
from pneudrive.report.page import Topic, figure_of, view_report
from pneudrive.report.render import DrawnFigure, applied, draw_figure, film
from pneudrive.simulation.trajectory import check_target, columns_in, read_columns, whole, write_whole
from pneudrive.views import ShownFigure, ShownValue, State, View, worst

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike
    from PIL import Image


# --- A platform on legs as lines in one isometric projection, for SVG text, figures and the page.

#: Rows of the projection: x to the lower right, y to the upper right, z up.
VIEW = np.array([[0.866, 0.866, 0.0], [0.35, -0.35, -0.937]])
#: Width of a picture, its margin and the size of labels, px.
WIDTH, MARGIN, FONT = 360.0, 30.0, 11.0
#: Pixels per inch of paper.
PX_IN = 100.0
#: Distances of a label from its joint, tried in turn, px, and number of angles for each distance.
DISTANCES = (13.0, 19.0, 25.0)
ANGLES = np.radians([0.0, 30.0, -30.0, 60.0, -60.0, 90.0, -90.0, 130.0, -130.0])
#: Length of the barrel of a leg without a stroke, as a fraction of the leg's length at x = 0.
BARREL = 0.6
#: Thickness of a piston, as a fraction of its barrel or guide.
PISTON = 0.08


#: Look of each part, as a stroke without points.
_LINES = package_table(__file__, "sketches.toml")["lines"]
LOOKS = {name: PenStroke((), cap="butt", **table) for name, table in _LINES.items()}


def platform_lines(platform: Platform, poses: ArrayLike) -> Iterator[tuple[str, int, Array]]:
    """Yield the lines of a platform: name of the element, number of the leg from 1 (0: no leg), and points.

    Points are in m and have the shape (m, k, 3), or (1, k, 3) for lines at rest.

    The last line is the path of the origin, with the shape (m, 1, 3).

    Parameters
    ----------
    platform : Platform
    poses : array, shape (m, n)
    """
    own = platform.evaluate(poses)
    frame, places, directions = (np.asarray(one, dtype=float).reshape(-1, 3) for one in platform.core.joints)
    origin, axes = own["frame"][:, 0], own["frame"][:, 1:]
    joints = origin[:, None] + places @ axes
    yield "frame", 0, frame[None, [*range(len(frame)), 0]]
    for number, leg in enumerate(platform.legs, start=1):
        i = number - 1
        a, joint, x = frame[i], joints[:, i], own["positions"][:, i, None]
        if platform.is_delta:
            stroke = leg.stroke_m if np.isfinite(leg.stroke_m) else max(np.abs(x).max(), 0.1)
            along, half = directions[i], 0.5 * PISTON * stroke
            yield "guide", number, np.array([[a, a + stroke * along]])
            yield "piston", number, np.stack([a + (x - half) * along, a + (x + half) * along], axis=1)
            yield "arm", number, np.stack([a + x * along, joint], axis=1)
            continue
        length = np.linalg.norm(joint - a, axis=1, keepdims=True)
        along, shortest = (joint - a) / length, (length - x).mean()
        barrel = min(1.1 * leg.stroke_m if np.isfinite(leg.stroke_m) else BARREL * shortest, 0.95 * shortest)
        head = shortest - barrel
        piston = head + np.clip(x + 0.01 * barrel, 0.01 * barrel, (0.99 - PISTON) * barrel)
        at = [a + distance * along for distance in (0.0 * x, head + 0.0 * x, piston, piston + PISTON * barrel)]
        yield "rod", number, np.stack(at[:2], axis=1)
        yield "rod", number, np.stack([at[3], joint], axis=1)
        yield "barrel", number, np.stack([at[1], a + shortest * along], axis=1)
        yield "piston", number, np.stack(at[2:], axis=1)
    yield "platform", 0, joints[:, [*range(len(frame)), 0]]
    yield "path", 0, origin[:, None]


def platform_scene(platform: Platform, poses: ArrayLike, size: float = 1.0) -> tuple[Pair, list[PenStroke]]:
    """Return the size of the drawing of a platform, in px, and its strokes at all poses, with y downwards.

    The points of a stroke have the shape (m, k, 2). For elements at rest, labels and the path of the origin, it is
    (1, k, 2).

    Parameters
    ----------
    platform : Platform
    poses : array, shape (m, n)
    size : float
        Scale of stroke widths and label sizes; 1 for `PX_IN` pixels per inch of paper.
    """
    lines = [(part, points @ VIEW.T) for part, _, points in platform_lines(platform, poses)]
    everything = np.concatenate([points.reshape(-1, 2) for _, points in lines])
    low, high = everything.min(axis=0), everything.max(axis=0)
    across, up = high - low
    scale = (WIDTH - 2.0 * MARGIN) / max(across, 0.8 * up, 1e-9)
    width, height = (high - low) * scale + 2.0 * MARGIN
    *lines, (_, path) = [(part, (points - low) * scale + MARGIN) for part, points in lines]
    strokes = []
    for part, points in [*lines, ("path", path.reshape(1, -1, 2))]:
        own = LOOKS[part]
        dash = [length / own.width for length in own.dash]
        strokes.append(replace(own, points=points, width=72.0 / PX_IN * own.width * size, dash=dash))
    # Labels are on the outer side of their joints, where they do not overlap.
    centres: list[Array] = []
    for joint in lines[0][1][0, :-1]:
        outward = joint - np.array([width, height]) / 2.0
        angles = np.arctan2(outward[1], outward[0]) + ANGLES
        turned = np.column_stack([np.cos(angles), np.sin(angles)])
        tried = [joint + distance * direction for distance in DISTANCES for direction in turned]
        free = (at for at in tried if all(np.max(np.abs(at - other) / [0.8, 1.1]) > FONT for other in centres))
        centres.append(next(free, tried[0]))
    text_pt = 72.0 / PX_IN * FONT * max(size, 0.6)
    strokes += [PenStroke(centre[None, None], str(i), size=text_pt) for i, centre in enumerate(centres, start=1)]
    return (width, height), strokes


# --- A platform on legs as a picture, as an animation of a run, and as a page of a run with its curves.


#: Colours of a GIF: two inks, and their mixtures with the paper.
COLOURS = 64
#: Frames per second. Delays of a GIF are multiples of 10 ms.
FRAMES_S = {".mp4": 30, ".gif": 25}
#: Shortest and longest animation, s. Shorter runs are slowed down, longer runs are sped up.
SHORTEST_S, LONGEST_S = 2.0, 20.0
MOST_POSES = 400  # of a path
#: Panels of legs: label, and the form of its columns.
LEG_PANELS = Topic("trajectory", "legs").texts["panels"]


def draw_platform(
    platform: Platform, poses: ArrayLike | None = None, path: str | Path | None = None, *, dark: bool = False
) -> DrawnFigure:
    """Draw a platform at the last of the given poses, with the path of its origin.

    Parameters
    ----------
    platform : Platform
    poses : array, shape (n,) or (m, n), optional
        One pose or the poses of a run, in m and rad. By default every leg is at half of its stroke.
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
    shown = np.atleast_2d(platform.home if poses is None else platform.pose(poses))
    (width, height), strokes = platform_scene(platform, shown)
    texts = [(0.02 * width, 0.02 * height + FONT, "simulated")] if len(shown) > 1 else []
    return draw_figure(_paper((width, height), strokes, -1, *texts), path, dark=dark)


def animate_platform(
    platform: Platform, time: ArrayLike, poses: ArrayLike, path: str | Path, *, dark: bool = False
) -> Path:
    """Write a run of a platform as a film. The film lasts as long as the run, but at least 2 s and at most 20 s.

    Parameters
    ----------
    platform : Platform
    time : array, shape (m,)
        Increasing times of the poses, in s.
    poses : array, shape (m, n)
        Poses, in m and rad.
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
    lasts = min(max(time[-1] - time[0], SHORTEST_S), LONGEST_S)
    moments = np.linspace(time[0], time[-1], round(lasts * FRAMES_S[suffix]) + 1)
    rows = np.searchsorted(time, moments, side="right") - 1
    scene = platform_scene(platform, np.asarray(poses, dtype=float)[rows])
    from PIL.Image import Dither

    pictures = (_paper(*scene, k, (6.0, 16.0, f"{t:.3f} s, simulated")) for k, t in enumerate(moments))
    with applied(dark=dark), whole(target) as temporary:
        frames = film(pictures)
        if program is not None and suffix == ".mp4":
            _write_film(program, frames, temporary)
        else:
            first = next(frames).quantize(COLOURS)
            others = (frame.quantize(palette=first, dither=Dither.NONE) for frame in frames)
            first.save(temporary, save_all=True, append_images=others, duration=1000 // FRAMES_S[suffix], loop=0)
    return target


def _write_film(program: str, frames: Iterator[Image.Image], target: Path) -> None:
    """Write frames as an H.264 film by ffmpeg."""
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


def scene_drawing(size: Pair, strokes: Sequence[PenStroke], row: int = -1) -> Drawing:
    """Return the drawing of a scene at one pose, with the path over all poses."""
    posed = [replace(stroke, points=stroke.points[row if len(stroke.points) > 1 else 0]) for stroke in strokes]
    return Drawing(posed, (0.0, size[0]), (size[1], 0.0), equal=True)


def _paper(size: Pair, strokes: Sequence[PenStroke], row: int, *texts: tuple[float, float, str]) -> Figure:
    """Return a figure with the size of a scene, rounded to even numbers of pixels, as films require.

    `texts` have positions in px.
    """
    width, height = (4.0 * round(0.25 * side) / PX_IN for side in size)
    text_pt = 72.0 / PX_IN * FONT
    notes = [PenStroke(np.array([[(x, y)]]), text, size=text_pt, align="left baseline") for x, y, text in texts]
    drawing = scene_drawing(size, [*strokes, *notes], row)
    return Figure([Panel([drawing])], row_in=height, rest_in=0.0, width_in=width, has_margins=False)


# --- page of a run ---------------------------------------------------------------------------------------------------


def run_columns(platform: Platform) -> list[str]:
    """Return the names of the columns of a run that the pictures of a platform use, time first."""
    legs = [form for _, form in LEG_PANELS if form.startswith("{leg}")]
    own = [form.format(leg=leg.name) for form in legs for leg in platform.legs]
    return ["time_s", *(name for row in pose_columns(platform) for name in row), *own]


def read_platform_run(platform: Platform, path: str | Path) -> Columns:
    """Read, from the file of a run, the columns that the pictures of a platform use.

    Raises
    ------
    RecordingError
        The file does not exist or is damaged.
    CommandError
        The file is not a run of this platform.
    """
    found = read_columns(path, columns_in(path, run_columns(platform)))
    motion_of(platform, found)
    return found


def write_platform_page(platform: Platform, columns: Columns, path: str | Path) -> Path:
    """Write a page of a run of a platform. The page loads no other files.

    Parameters
    ----------
    platform : Platform
    columns : mapping
        Columns of the run, in SI.
    path : path-like
        .html.

    Raises
    ------
    CommandError
        The run has no column of this platform, or the file cannot be written.
    """
    target = check_target(path, (".html",))
    report = view_report(platform_run_view(platform, columns), synthetic=True)
    return write_whole(target, report.alone())


def platform_view(platform: Platform) -> View:
    """Return the view of a platform: strokes and loads of the legs at half stroke, limits of coordinates, a drawing."""
    home, limits = platform.home, platform.workspace()
    legs = zip(platform.legs, platform.inverse(home), platform.load(home), strict=True)
    rows = []
    for leg, x, force in legs:
        texts = {"position": f"{1e3 * x:.4g} mm", "stroke": f"{1e3 * leg.stroke_m:.4g} mm", "load": f"{force:.4g} N"}
        rows += [ShownValue(f"{leg.name}.{name}", leg.name, name, text) for name, text in texts.items()]
    table = []
    for k, (key, both) in enumerate(limits.limits.items()):
        poses, ends = np.array([home, home]), []
        for pose, limit in zip(poses, both, strict=True):
            pose[k] = limit.value
            ends += [platform.text(pose).split(", ")[k].partition(" = ")[2], limit.reason]
        least = platform.singular_values(poses)[:, -1].min()
        table.append((key, *ends, least, abs(platform.load(poses)).max()))
    values = ", ".join(f"{value:.4g}" for value in platform.singular_values(home))
    drawing = _paper(*platform_scene(platform, np.atleast_2d(home)), -1)
    picture = ShownFigure(platform.name, f"{platform.name}, every leg at half of its stroke.", drawing)
    return View(
        f"{platform.name}: {platform.text(home)}, with every leg at half of its stroke",
        rows,
        notes=(f"singular values, without unit: {values}",),
        tables=(Topic("trajectory", "platform").table(table),),
        figures=(picture,),
    )


def platform_run_view(platform: Platform, columns: Columns) -> View:
    """Return the view of a run: ranges of its curves, drawing of the platform at its end, and the curves."""
    found = {**columns, **platform_outputs(platform, columns)}
    rows, time = [], columns["time_s"]
    for label, each in _panels(platform, found):
        for name, curve in each.items():
            ends = Axis(label).shown((curve.min(), curve.max()))
            rows.append((name, label, *(round(float(end), 6) + 0.0 for end in ends)))
    caption = f"{platform.name} at the end of the run with the path of its origin, and the curves of the run."
    sentences, leading = _answer(platform, found)
    return View(
        " ".join(sentences),
        leading=leading,
        state=worst(leading),
        tables=(Topic("trajectory", "legs").table(rows),),
        figures=(ShownFigure(platform.name, caption, run_figure(platform, found)),),
        notes=(f"{len(time)} samples to {time[-1]:g} s",),
    )


def _answer(platform: Platform, columns: Columns) -> tuple[list[str], list[ShownValue]]:
    """Return sentences on a run, and its leading values: path error, distance to stroke ends, singularity, force."""
    own, legs = platform.name, platform.legs
    sentences, leading = [], []
    errors = [
        np.abs(columns[name] - columns[wanted])
        for name in pose_columns(platform)[0]
        if name.endswith("_m") and (wanted := f"{name.removesuffix('_m')}_reference_m") in columns
    ]
    if errors:
        error = np.max(errors)
        sentences.append(f"The path is kept within {1e3 * error:.3g} mm.")
        leading.append(ShownValue("path error", own, "largest error of the path", error, "m"))
    margins = [
        np.minimum(x, leg.stroke_m - x).min()
        for leg in legs
        if np.isfinite(leg.stroke_m) and (x := columns.get(f"{leg.name}.position_m")) is not None
    ]
    if margins:
        margin, hit = max(min(margins), 0.0), sum(one <= 0.0 for one in margins)
        ends = f"{hit} of {len(legs)} legs reach{'es' if hit == 1 else ''} an end of the stroke."
        sentences.append(ends if hit else f"No leg comes nearer than {1e3 * margin:.3g} mm to an end of its stroke.")
        state: State = "open" if hit else "good"
        words = "least distance of a leg to an end"
        leading.append(ShownValue("leg margin", own, words, margin, "m", limit=0.0, state=state))
    singular = columns[f"{own}.smallest_singular_value"].min()
    is_regular = singular >= LEAST_SINGULAR_VALUE
    sentences.append("No pose is singular." if is_regular else "The platform passes a nearly singular pose.")
    state, limit = "good" if is_regular else "bad", LEAST_SINGULAR_VALUE
    leading.append(ShownValue("singular value", own, "smallest singular value", singular, limit=limit, state=state))
    forces = np.column_stack([columns[f"{own}.leg_{i}_force_n"] for i in range(1, len(legs) + 1)])
    signs = (forces >= 0.0).astype(int)
    limits = np.take_along_axis(np.broadcast_to(platform.force_limits, (*signs.shape, 2)), signs[..., None], 2)[..., 0]
    at = np.unravel_index(np.argmax(forces / limits if np.isfinite(limits).all() else np.abs(forces)), forces.shape)
    limit = limits[at] if np.isfinite(limits[at]) else None
    force, state = forces[at], "good" if limit is None or abs(forces[at]) <= abs(limit) else "open"
    leading.append(ShownValue("leg force", own, "largest force along a leg", force, "N", limit=limit, state=state))
    return sentences, leading


def _panels(platform: Platform, columns: Columns) -> list[tuple[str, Columns]]:
    """Return the label and the named curves of each panel."""
    pose, panels = pose_columns(platform)[0], []
    for label, unit in (("place / mm", "m"), ("tilt / deg", "rad")):
        each = {platform.coordinates[k]: columns[pose[k]] for k, own in enumerate(platform.units) if own == unit}
        panels.append((f"{next(iter(each))} / mm" if len(each) == 1 else label, each))
    smallest = columns[f"{platform.name}.smallest_singular_value"]
    panels.append(("smallest singular value", {platform.name: smallest}))
    for label, form in LEG_PANELS:
        legs = enumerate((leg.name for leg in platform.legs), start=1)
        names = {leg: form.format(platform=platform.name, i=i, leg=leg) for i, leg in legs}
        panels.append((label, {leg: columns[name] for leg, name in names.items() if name in columns}))
    return [panel for panel in panels if panel[1]]


def run_figure(platform: Platform, columns: Columns) -> Figure:
    """Draw the platform at the end of a run and the curves of the run. One legend names the legs."""
    time, pose = columns["time_s"], motion_of(platform, columns)[0]
    part, legs, panels = thin(time), {leg.name for leg in platform.legs}, []
    of_legs: dict[str, Line] = {}
    for label, each in _panels(platform, columns):
        named = enumerate(each.items())
        lines = [Line(time[part], values[part], name, look(i), 1.0) for i, (name, values) in named]
        if legs.issuperset(each):
            of_legs |= {line.label: line for line in lines}
        how = "" if legs.issuperset(each) or len(each) < 2 else "inside"
        panels.append(Panel(lines, label, y=Axis(label, is_named=False), legend=how))
    drawing = scene_drawing(*platform_scene(platform, pose[evenly(len(pose), MOST_POSES)], size=0.6))
    keys = [Line([], [], label, line.look) for label, line in of_legs.items()]
    return figure_of("platform", panels, tall=Panel([drawing, *keys], legend="under"))
