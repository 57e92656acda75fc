"""Chance that does not depend on the order in which things happen.

Every draw is a pure function of (seed, rule, source, destination, tick): a counter-based generator after SplitMix64
(Steele, Lea, Flood 2014). So two runs that ask in another order, or in another process, see the same luck.
"""

import numpy as np

from protocols.kernels import kernel

# The rules that draw; each has numbers of its own.
BURST = 1
LOSS = 2
JITTER = 3
REORDER = 4
DUPLICATE = 5

_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_MIX_A = np.uint64(0xBF58476D1CE4E5B9)
_MIX_B = np.uint64(0x94D049BB133111EB)
_TO_UNIT = 1.0 / 9007199254740992.0  # 2^-53


@kernel
def _mixed(state: np.uint64) -> np.uint64:
    state = (state ^ (state >> np.uint64(30))) * _MIX_A
    state = (state ^ (state >> np.uint64(27))) * _MIX_B
    return state ^ (state >> np.uint64(31))


@kernel
def uniform(seed: int, rule: int, source: int, destination: int, tick: int) -> float:
    """A number in [0, 1) that belongs to exactly these five integers."""
    link = (np.uint64(rule) << np.uint64(32)) | (np.uint64(source) << np.uint64(16)) | np.uint64(destination)
    state = _mixed(np.uint64(seed) * _GAMMA + _GAMMA)
    state = _mixed(state ^ (link * _GAMMA))
    state = _mixed(state + np.uint64(tick) * _GAMMA)
    return float(state >> np.uint64(11)) * _TO_UNIT
