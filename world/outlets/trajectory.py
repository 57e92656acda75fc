"""A recorded flight as arrays, and the file it is kept in: ``trajectory.npz`` of a run directory (docs/recordings.md).

Every array has one row per tick. Row t holds the state at the beginning of tick t, so row 0 is the start and the last row the
end. Metres and seconds; the frame is the mission's: x forward, y left, the virtual target starts at the origin.
"""

import math
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from protocols.errors import SwarmError
from protocols.whole_file import whole_file

_MOST_BYTES = 1 << 32  # of one array: 250 drones for an hour are less


class TrajectoryError(SwarmError):
    """No recorded flight can be read from a file; one line says why."""


@dataclass(frozen=True)
class Trajectory:
    """Where N drones were at T moments, x forward, y left. Arrays are the recorder's own: copy them before writing to them.

    Attributes:
        positions: (T, N, 2) m. A drone that is out of the air stays where it was lost.
        velocities: (T, N, 2) m/s.
        slots: (T, N) the slot each drone says it holds.
        flying: (T, N) whether the drone is in the air.
        obstacles: (M, 3) discs: x, y, radius, m; in the order of their numbers in reports.
        goal_x: the line every drone must pass, m. Not less than the far side of every obstacle.
        tick_s: seconds from row to row.
    """

    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    slots: NDArray[np.int16]
    flying: NDArray[np.bool_]
    obstacles: NDArray[np.float64]
    goal_x: float
    tick_s: float

    @property
    def times(self) -> NDArray[np.float64]:
        """(T,) seconds since the start, of every row."""
        return np.arange(len(self.positions), dtype=np.float64) * self.tick_s

    def until(self, rows: int) -> Self:
        """Its first ``rows`` rows."""
        kept = slice(rows)
        return replace(
            self, positions=self.positions[kept], velocities=self.velocities[kept], slots=self.slots[kept],
            flying=self.flying[kept],
        )  # fmt: skip

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """The flight recorded in the file ``path``.

        Raises:
            TrajectoryError: no such file, or it is not a recorded flight.
        """
        try:
            with zipfile.ZipFile(path) as saved:
                positions = _array(saved, "positions", np.float64, (None, None, 2))
                moments, drones, _ = positions.shape
                goal_x = _array(saved, "goal_x", np.float64, ())
                tick_s = _array(saved, "tick_s", np.float64, ())
                return cls(
                    positions,
                    _array(saved, "velocities", np.float64, (moments, drones, 2)),
                    _array(saved, "slots", np.int16, (moments, drones)),
                    _array(saved, "flying", np.bool_, (moments, drones)),
                    _array(saved, "obstacles", np.float64, (None, 3)),
                    float(goal_x),
                    float(tick_s),
                )
        # What a file can do to the readers of zip files and arrays has no base of its own.
        except Exception as error:
            reason = getattr(error, "strerror", None) or error
            raise TrajectoryError(f"{path}: is not a recorded flight ({reason})") from None

    def save(self, path: Path | str) -> None:
        """Write an ``.npz`` file; it is complete or it is not there.

        Raises:
            protocols.whole_file.WriteError: it cannot be written.
        """
        with whole_file(Path(path)) as file:
            np.savez_compressed(
                file,
                positions=self.positions,
                velocities=self.velocities,
                slots=self.slots,
                flying=self.flying,
                obstacles=self.obstacles,
                goal_x=self.goal_x,
                tick_s=self.tick_s,
            )


def _array(
    saved: zipfile.ZipFile, name: str, kind: type[np.generic], shape: tuple[int | None, ...]
) -> NDArray[Any]:
    """One array of the file, if it has this kind and shape (None: any length). Looks before it makes room: a header may lie.

    Raises:
        ValueError: it has another. Else whatever the readers raise.
    """
    member = saved.getinfo(f"{name}.npy")
    with saved.open(member) as file:
        version = npy.read_magic(file)
        read_header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        given, _, written_kind = read_header(file)
        fits = len(given) == len(shape) and all(
            a == b or b is None for a, b in zip(given, shape, strict=True)
        )
        if written_kind != kind or not fits or min(given, default=0) < 0:
            raise ValueError(f"{name}: an array of {written_kind}, shape {given}")
        if math.prod(given) * written_kind.itemsize > min(member.file_size, _MOST_BYTES):
            raise ValueError(f"{name}: an array of {math.prod(given)} numbers is longer than its file")
    with saved.open(member) as file:
        array: NDArray[Any] = npy.read_array(file, allow_pickle=False)
        return array
