"""A recorded flight as arrays, and the file it is kept in: ``trajectory.npz`` of a run directory (docs/recordings.md).

Every array has one row per tick. Row t holds the state at the beginning of tick t, so row 0 is the start and the last row the
end. Metres and seconds; the frame is the mission's: x forward, y left, the virtual target starts at the origin.
"""

import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from protocols.errors import SwarmError
from protocols.whole_file import whole_file


class TrajectoryError(SwarmError):
    """No recorded flight can be read from a file; one line says why."""


@dataclass(frozen=True)
class Trajectory:
    """Where N drones were at T moments. Arrays are the recorder's own: copy them before writing to them."""

    positions: NDArray[np.float64]
    """(T, N, 2) m. A drone that is out of the air stays where it was lost."""
    velocities: NDArray[np.float64]
    """(T, N, 2) m/s."""
    slots: NDArray[np.int16]
    """(T, N) the slot each drone says it holds."""
    flying: NDArray[np.bool_]
    """(T, N) whether the drone is in the air."""
    obstacles: NDArray[np.float64]
    """(M, 3) discs: x, y, radius, m; in the order of their numbers in reports."""
    goal_x: float
    """The line every drone must pass, m. Not less than the far side of every obstacle."""
    tick_s: float
    """Seconds from row to row."""

    @property
    def times(self) -> NDArray[np.float64]:
        """(T,) seconds since the start, of every row."""
        return np.arange(len(self.positions), dtype=np.float64) * self.tick_s

    @classmethod
    def load(cls, path: Path | str) -> Self:
        """The flight recorded in the file ``path``.

        Raises:
            TrajectoryError: no such file, or it is not a recorded flight.
        """
        try:
            with np.load(path) as saved:
                return cls(
                    saved["positions"], saved["velocities"], saved["slots"], saved["flying"], saved["obstacles"],
                    float(saved["goal_x"]), float(saved["tick_s"]),
                )  # fmt: skip
        except (OSError, KeyError, ValueError, EOFError, zipfile.BadZipFile, AttributeError) as error:
            reason = getattr(error, "strerror", None) or " ".join(str(error).split())
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
