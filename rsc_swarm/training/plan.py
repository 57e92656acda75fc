"""What a network's numbers mean: the planned motion over the horizon."""

import torch
from torch import Tensor, nn

from protocols.dynamics import TICK_S
from rsc_swarm.training.config import TrainingConfig


class Plan(nn.Module):
    """Turns outputs (..., size) into displacement [m], velocity change [m/s] and acceleration [m/s²], (..., H, 2) each.

    Displacements are r^{h+1} - (h+1) dt v(t): relative to flying on as now. With output raw the network gives them; else
    it gives accelerations at evenly spaced knots, which are joined by straight lines and integrated as drones move.
    """

    travel: Tensor
    to_velocity: Tensor
    to_position: Tensor
    from_knots: Tensor

    def __init__(self, config: TrainingConfig) -> None:
        super().__init__()
        self.horizon, self.raw = config.horizon, config.output == "raw"
        self.scale_m = config.duration_s**2 / 3
        self.points = self.horizon if self.raw else config.knot_count
        self.size = 2 * self.points
        travel, from_knots = _trapezoid(self.horizon), _hats(self.horizon, self.points)
        to_velocity = TICK_S * torch.ones(self.horizon, self.horizon).tril() @ from_knots
        self.register_buffer("travel", travel, persistent=False)
        self.register_buffer("to_velocity", to_velocity, persistent=False)
        self.register_buffer("to_position", travel @ to_velocity, persistent=False)
        self.register_buffer("from_knots", from_knots, persistent=False)

    def travelled(self, change: Tensor) -> Tensor:
        """Displacements [m] that follow from velocity changes [m/s], both (..., H, 2)."""
        return (change.transpose(-1, -2) @ self.travel.T).transpose(-1, -2)

    def forward(self, output: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        # A model file's outputs are (B, size): a tensor asked for its shape would put that into the file.
        leading = (-1,) if output.dim() == 2 else output.shape[:-1]
        points = output.reshape(*leading, 2, self.points)
        if self.raw:
            displacement = (self.scale_m * points).transpose(-1, -2)
            nothing = (
                0.0 * displacement
            )  # computed: a constant would fix the number of drones in the model file
            return displacement, nothing, nothing
        # One flat product each, instead of one per drone.
        position, velocity, acceleration = (
            (points @ matrix.T).transpose(-1, -2)
            for matrix in (self.to_position, self.to_velocity, self.from_knots)
        )
        return position, velocity, acceleration


def _trapezoid(steps: int) -> Tensor:
    """(H, H) [s]: displacements from the velocity changes after each step, as the dynamics integrate them."""
    change = torch.eye(steps)
    before = torch.cat([torch.zeros(1, steps), change[:-1]])
    return 0.5 * TICK_S * (before + change).cumsum(0)


def _hats(steps: int, knots: int) -> Tensor:
    """(H, M) weights of M evenly spaced knots at each of H steps: piecewise linear, the last knot at the last step."""
    place = torch.linspace(0, knots - 1, steps)[:, None]
    return (1 - (place - torch.arange(knots)).abs()).clamp(min=0)
