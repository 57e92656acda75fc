"""A flight as a film, GIF or MP4: every drone with its number and the last of its way, the tree that joins them, what happens."""

import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from protocols.whole_file import write_whole
from rsc_swarm.flight.events import Event
from rsc_swarm.flight.recorded import Recorded
from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.show.plots.events import NUMBERED, SWAP
from rsc_swarm.show.plots.flight import bounds, colours, draw_field, edges
from rsc_swarm.show.plots.style import ALARM, INK, ROCK, PlotError, bare, halo, new_figure, number

Film = Literal["gif", "mp4"]

_WIDTH, _TALLEST = 9.6, 9.6  # inches
_DOTS = 100  # per inch
_TRAIL_S = 2.0
_TOLD_S = 1.6  # so long is told what happened
_SWAP_S = 0.5  # so long a swap is marked
_LINGER_S = 2.0  # on the last picture
_MANY = 60  # drones: smaller, and their numbers without halos, which take long to draw


class _Kind(NamedTuple):
    """frames_hz: pictures in a second of the film. pace: seconds of flight in one of the film. most: pictures."""

    frames_hz: int
    pace: float
    most: int


_KINDS: dict[Film, _Kind] = {"gif": _Kind(10, 2.0, 300), "mp4": _Kind(25, 1.0, 1500)}


def film(
    track: Recorded, out: Path, kind: Film, on_frame: Callable[[int, int], None] = lambda done, total: None
) -> None:
    """Make a film of a flight; a GIF runs at twice its speed, an MP4 at its speed, a long flight faster.

    Args:
        on_frame: told how many pictures of how many are drawn.

    Raises:
        PlotError: matplotlib or ffmpeg is missing, or ffmpeg fails. protocols.whole_file.WriteError: it cannot be written.
    """
    if kind == "mp4" and not shutil.which("ffmpeg"):
        raise PlotError(f"--mp4 {out}: needs ffmpeg, which is not here: apt install ffmpeg, or give --gif")
    hertz, pace, most = _KINDS[kind]
    last = len(track.path.slots) - 1
    step = max(round(pace / hertz / track.path.tick_s), -(-last // most), 1)
    pictures = _pictures(track, [*range(0, last, step), last], on_frame)
    write_whole(out, _gif(pictures, hertz) if kind == "gif" else _mp4(pictures, hertz, out))


def _pictures(
    track: Recorded, ticks: Sequence[int], on_frame: Callable[[int, int], None]
) -> Iterator[NDArray[np.uint8]]:
    """(height, width, 3) for each tick."""
    scene = _Scene(track)
    for done, tick in enumerate(ticks):
        on_frame(done, len(ticks))
        yield scene.at(tick)


def _gif(pictures: Iterator[NDArray[np.uint8]], hertz: int) -> bytes:
    from PIL import Image

    first, *others = [Image.fromarray(picture).quantize(128) for picture in pictures]
    times = [1000 // hertz] * len(others) + [round(1000 * _LINGER_S)]
    made = BytesIO()
    first.save(made, "gif", save_all=True, append_images=others, duration=times, loop=0)
    return made.getvalue()


def _mp4(pictures: Iterator[NDArray[np.uint8]], hertz: int, out: Path) -> bytes:
    picture = next(pictures)
    tall, wide = picture.shape[:2]
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{wide}x{tall}", "-r", str(hertz), "-i", "-"]
    with passing_folder() as folder:
        made = folder / "film.mp4"
        coder = subprocess.Popen(
            ["ffmpeg", "-loglevel", "error", *raw, "-pix_fmt", "yuv420p", "-movflags", "faststart", str(made)],
            stdin=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip
        assert coder.stdin
        try:
            coder.stdin.write(picture.tobytes())
            for picture in pictures:
                coder.stdin.write(picture.tobytes())
            for _ in range(round(_LINGER_S * hertz)):
                coder.stdin.write(picture.tobytes())
        except BrokenPipeError:
            pass  # it has said why
        finally:
            said = coder.communicate()[1].decode(errors="replace").strip().splitlines()
        if coder.returncode:
            why = said[-1] if said else f"exit code {coder.returncode}"
            raise PlotError(f"--mp4 {out}: ffmpeg cannot make it ({why})")
        return made.read_bytes()


class _Scene:
    """The picture that moves: what stands still is drawn once."""

    def __init__(self, track: Recorded) -> None:
        self._track, self._events, path = track, track.events, track.path
        low, high = bounds(track)
        tall = (_WIDTH - 0.9) * float((high[1] - low[1]) / (high[0] - low[0])) + 1.2
        self._figure = new_figure(_WIDTH, round(min(max(tall, 2.4), _TALLEST) * _DOTS / 2) * 2 / _DOTS)
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.collections import LineCollection

        self._figure.set_dpi(_DOTS)
        self._canvas: Any = FigureCanvasAgg(self._figure)
        self._axes: Any = self._figure.subplots()
        axes, agents = self._axes, path.flying.shape[1]
        bare(axes)
        draw_field(axes, track)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", xlabel="x, m", ylabel="y, m")
        self._colours = colours(path)
        self._trails = axes.add_collection(LineCollection([], lw=1.6))
        self._edges = axes.add_collection(LineCollection([], colors=INK, lw=1.1, alpha=0.8))
        self._swaps = axes.plot([], [], SWAP.marker, ms=14, mfc="none", mec=SWAP.edge, mew=1.1)[0]
        size = 46.0 if agents <= _MANY else 20.0
        start = path.positions[0]
        self._drones = axes.scatter(*start.T, s=size, c=self._colours, edgecolors=INK, linewidths=0.8)
        self._numbers = [number(axes, agent, start[agent]) for agent in range(agents)]
        for written in self._numbers if agents > _MANY else ():
            written.set(path_effects=[], fontsize=6)
        self._when = axes.text(0.0, 1.02, "", transform=axes.transAxes, va="bottom", fontsize=12, color=INK)
        self._told = axes.text(
            1.0, 1.02, "", transform=axes.transAxes, ha="right", va="bottom", fontsize=10, path_effects=halo("white", 4)
        )  # fmt: skip
        self._to_mark = [event for event in self._events if event.what in NUMBERED and event.place_m]
        self._moving: list[Any] = [
            self._trails,
            self._edges,
            self._swaps,
            self._drones,
            *self._numbers,
            self._when,
            self._told,
        ]
        for artist in self._moving:
            artist.set_animated(True)
        self._figure.subplots_adjust(left=0.07, right=0.985, top=1 - 0.45 / tall, bottom=0.55 / tall)
        self._still()

    def _still(self) -> None:
        """Draw what does not move."""
        self._canvas.draw()
        self._ground = self._canvas.copy_from_bbox(self._figure.bbox)

    def at(self, tick: int) -> NDArray[np.uint8]:
        """The picture of this moment, (height, width, 3)."""
        path, flying = self._track.path, self._track.path.flying[tick]
        there, now_s = np.flatnonzero(flying).tolist(), tick * path.tick_s
        first = max(0, tick - round(_TRAIL_S / path.tick_s))
        self._drones.set_offsets(np.where(flying[:, None], path.positions[tick], np.nan))
        self._edges.set_segments(edges(path, self._track.mission.layout, tick))
        self._trails.set_segments([path.positions[first : tick + 1 : 4, agent] for agent in there])
        self._trails.set_color([(*self._colours[agent, :3], 0.55) for agent in there])
        for agent, written in enumerate(self._numbers):
            written.set_visible(bool(flying[agent]))
            written.xy = tuple(path.positions[tick, agent])
        lately = [event for event in self._events if now_s - _SWAP_S < event.time_s <= now_s and event.slots]
        self._swaps.set_data(*path.positions[tick, [agent for event in lately for agent in event.agents]].T)
        self._mark(tick)
        self._tell(tick, len(there))
        self._canvas.restore_region(self._ground)
        for artist in self._moving:
            self._axes.draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()

    def _mark(self, tick: int) -> None:
        """Deaths, restarts and the like stay marked from then on."""
        due = [event for event in self._to_mark if event.tick <= tick]
        for event in due:
            mark = NUMBERED[event.what]
            assert event.place_m
            self._axes.plot(*event.place_m, mark.marker, ms=mark.size, mfc=mark.face, mec=mark.edge, zorder=7)
            number(self._axes, event.agents[0], event.place_m, colour=mark.face)
        if due:
            self._to_mark = [event for event in self._to_mark if event.tick > tick]
            self._still()

    def _tell(self, tick: int, flying: int) -> None:
        path, track = self._track.path, self._track
        now_s, over, agents = tick * path.tick_s, tick == len(path.slots) - 1, path.flying.shape[1]
        drones = f"{agents} drone{'s' if agents > 1 else ''}{f', {agents - flying} lost' if flying < agents else ''}"
        self._when.set_text(track.verdict if over else f"{now_s:5.2f} s   {drones}")
        self._when.set_color(ALARM if over and track.failure else INK)
        told = [event for event in self._events if _is_told(event, now_s)]
        self._told.set_text(told[-1].text if told and not over else "")
        self._told.set_color(ALARM if told and told[-1].what in ("kill", "lost", "collision") else ROCK)


def _is_told(event: Event, now_s: float) -> bool:
    return now_s - _TOLD_S < event.time_s <= now_s and event.what not in ("start", "end", "closest")
