"""The policy network (paper, Sec. III-A): two streams, one over what the neighbours said, one over the own target.

There are two ways in to one set of weights. `graphs` takes whole swarms, as training has them: every drone's X_i is
embedded once and then gathered by its neighbours. `drones` takes what one drone has heard, as the model file does.
"""

import torch
from torch import Tensor, nn

from agent.observation import WIDE_SIZE
from protocols.wire.frames import OBSERVATION_SIZE
from rsc_swarm.training.config import PAST, TrainingConfig
from rsc_swarm.training.plan import Plan

TARGET_SIZE = 2
CLIP = 6.0


class Normal(nn.Module):
    """Z-scores, clipped; the means and deviations are measured once on recorded data."""

    mean: Tensor
    deviation: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(size))
        self.register_buffer("deviation", torch.ones(size))

    def measure(self, values: Tensor) -> None:
        """Take mean and deviation from values (..., size)."""
        flat = values.reshape(-1, values.shape[-1]).float()
        self.mean.copy_(flat.mean(0))
        self.deviation.copy_(flat.std(0).clamp(min=1e-2))

    def forward(self, values: Tensor) -> Tensor:
        return ((values - self.mean) / self.deviation).clamp(-CLIP, CLIP)


class PolicyNetwork(nn.Module):
    """What both kinds of network share: the ways in, the normalisation, and the plan that comes out.

    G graphs of N drones, B drones; L past steps, newest last; K neighbour places.
    """

    def __init__(self, config: TrainingConfig) -> None:
        super().__init__()
        self.past, self.hops = config.past, config.aggregation == "hops"
        self.local_size = TARGET_SIZE + (WIDE_SIZE if config.extra == "wide" else 0)
        self.normal_x = Normal(OBSERVATION_SIZE)
        self.normal_local = Normal(self.local_size)
        self.plan = Plan(config)

    @property
    def device(self) -> torch.device:
        """Where the weights are."""
        return self.plan.travel.device

    def graphs(self, observation: Tensor, near: Tensor, local: Tensor) -> Tensor:
        """Outputs (G, N, size) from X_i (G, 4, N, 18), neighbours' numbers (G, 3 or 4, N, K; -1: none), local (G, N, F).

        X_j(t-1) of the neighbours at t-1 is heard at t, so ``near`` belongs to the ticks of the observations before the
        newest; a later one is not looked at.
        """
        seen, shares = observation[:, PAST - self.past :], neighbour_shares(near[:, PAST - self.past : PAST])
        if self.hops:
            own = self.embed(self.normal_x(seen[:, 1:]))
            mean = self.embed(self.normal_x(relayed(seen[:, :-1], shares)))
        else:
            nodes = self.embed(self.normal_x(seen))
            own, mean = nodes[:, 1:], shares.to(nodes.dtype) @ nodes[:, :-1]
        own, mean = (steps.movedim(1, 2).flatten(0, 1) for steps in (own, mean))
        decided = self.decide(own, mean, self.normal_local(local).flatten(0, 1))
        return decided.reshape(*local.shape[:2], decided.shape[-1])

    def drones(self, own: Tensor, said: tuple[Tensor, ...], local: Tensor) -> Tensor:
        """Outputs (B, size) from own X_i (B, L, 18), local (B, F), and what others said: heard X_j (B, L, K, 18) and share
        (B, L, K), or where means are passed on, these alone (B, L, 18)."""
        if self.hops:
            nodes = self.embed(self.normal_x(torch.stack([own, said[0]], 2)))
            return self.decide(nodes[:, :, 0], nodes[:, :, 1], self.normal_local(local))
        heard, share = said
        nodes = self.embed(self.normal_x(torch.cat([own[:, :, None], heard], 2)))
        mean = (share[..., None, :] @ nodes[:, :, 1:]).squeeze(-2)
        return self.decide(nodes[:, :, 0], mean, self.normal_local(local))

    def embed(self, x: Tensor) -> Tensor:
        """Embedding (..., width) of normalised X_i (..., 18)."""
        raise NotImplementedError

    def decide(self, own: Tensor, mean: Tensor, local: Tensor) -> Tensor:
        """Outputs (B, size) from own embeddings and the mean of the neighbours' (B, L, width), and local inputs (B, F)."""
        raise NotImplementedError


def neighbour_shares(near: Tensor) -> Tensor:
    """(G, L, N, N) weights whose product with the nodes is the mean over each drone's neighbours; near (G, L, N, K)."""
    used = near >= 0
    share = used / used.sum(-1, keepdim=True).clamp(min=1)
    drones = near.shape[-2]
    weights = share.new_zeros(
        *near.shape[:-1], drones + 1
    )  # one more column takes the places without a neighbour
    return weights.scatter_add_(-1, torch.where(used, near, drones).long(), share)[..., :drones]


def relayed(observation: Tensor, shares: Tensor) -> Tensor:
    """(G, L, N, 18) means passed on until now (agent.relay), over L hops first: what was observed at a tick, (G, L, N, 18),
    averaged over the neighbours, shares (G, L, N, N), of that tick and of each one after it."""
    means = []
    for begin in range(observation.shape[1]):
        mean = observation[:, begin]
        for step in range(begin, observation.shape[1]):
            mean = shares[:, step].to(mean.dtype) @ mean
        means.append(mean)
    return torch.stack(means, 1)


class RscNetwork(PolicyNetwork):
    """The paper's network: MLP, GraphSAGE over the neighbours, transformer over time; MLP on the target; head."""

    def __init__(self, config: TrainingConfig) -> None:
        super().__init__(config)
        width = config.width
        self.node = nn.Sequential(
            nn.Linear(OBSERVATION_SIZE, width), nn.ReLU(), nn.Linear(width, width), nn.ReLU()
        )
        self.from_own = nn.Linear(width, width)
        self.from_neighbours = nn.Linear(width, width, bias=False)
        self.when = nn.Parameter(0.02 * torch.randn(config.past, width))
        self.time = NewestToken(config.past, width, config.heads, config.feedforward)
        self.local = nn.Sequential(
            nn.Linear(self.local_size, width),
            nn.LeakyReLU(),
            nn.Dropout(config.dropout),
            nn.Linear(width, width),
            nn.LeakyReLU(),
        )
        self.head = nn.Sequential(
            nn.Linear(2 * width, width), nn.LeakyReLU(), _quiet(nn.Linear(width, self.plan.size))
        )

    def embed(self, x: Tensor) -> Tensor:
        embedded: Tensor = self.node(x)
        return embedded

    def decide(self, own: Tensor, mean: Tensor, local: Tensor) -> Tensor:
        step = torch.relu(self.from_own(own) + self.from_neighbours(mean))
        context = self.time(step + self.when)
        decided: Tensor = self.head(torch.cat([context, self.local(local)], -1))
        return decided


class NewestToken(nn.Module):
    """One transformer encoder layer, of which only the newest token is read: the others need no query of their own."""

    def __init__(self, past: int, width: int, heads: int, feedforward: int) -> None:
        super().__init__()
        self.past, self.split = past, (heads, width // heads)
        self.query, self.value, self.out = (nn.Linear(width, width) for _ in range(3))
        self.key = nn.Linear(width, width, bias=False)
        self.after_attention, self.after_feedforward = nn.LayerNorm(width), nn.LayerNorm(width)
        self.feedforward = nn.Sequential(
            nn.Linear(width, feedforward), nn.ReLU(), nn.Linear(feedforward, width)
        )

    def forward(self, tokens: Tensor) -> Tensor:
        """(B, L, width) to (B, width)."""
        newest = tokens[:, -1]
        # Shapes in numbers, but for B: asking tensors for theirs would put that into the model file.
        query = self.query(newest).reshape(-1, 1, *self.split).float()
        # What all keys have in common changes no share. As tokens a tick apart have nearly all in common, its rounding would
        # be most of the gradient, which Adam makes grow without end: so it is taken out first.
        key = self.key(tokens - newest[:, None]).reshape(-1, self.past, *self.split).float()
        value = self.value(tokens).reshape(-1, self.past, *self.split)
        score = (query * key).sum(-1, keepdim=True) * self.split[1] ** -0.5  # (B, L, heads, 1)
        seen = (score.softmax(1) * value).sum(1).reshape(-1, self.split[0] * self.split[1])
        newest = self.after_attention(newest + self.out(seen))
        encoded: Tensor = self.after_feedforward(newest + self.feedforward(newest))
        return encoded


class StgnnNetwork(PolicyNetwork):
    """The baseline of Tolstaya et al. and Chen et al.: own X_i and delayed means (paper, Eq. 4) into an MLP; with aggregation
    ``hops`` as they have it, over K = L hops."""

    def __init__(self, config: TrainingConfig) -> None:
        super().__init__(config)
        width, size = config.width, (1 + config.past) * OBSERVATION_SIZE + self.local_size
        self.head = nn.Sequential(
            nn.Linear(size, width),
            nn.ReLU(),
            nn.Linear(width, width),
            nn.ReLU(),
            nn.Linear(width, width),
            nn.ReLU(),
            _quiet(nn.Linear(width, self.plan.size)),
        )

    def embed(self, x: Tensor) -> Tensor:
        return x

    def decide(self, own: Tensor, mean: Tensor, local: Tensor) -> Tensor:
        decided: Tensor = self.head(torch.cat([own[..., -1, :], mean.flatten(-2), local], -1))
        return decided


def _quiet(last: nn.Linear) -> nn.Linear:
    """A last layer that begins near zero, so that an untrained policy flies on as it does."""
    with torch.no_grad():
        last.weight.mul_(0.1)
        last.bias.zero_()
    return last


def make_network(config: TrainingConfig) -> PolicyNetwork:
    """An untrained network; torch's seed decides its weights."""
    return StgnnNetwork(config) if config.kind == "stgnn" else RscNetwork(config)
