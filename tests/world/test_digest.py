"""The digest of a flight is the hash of all its states, however many are gathered before they are hashed."""

import hashlib

import numpy as np

from world.digest import Digests


def of_one(states: list[tuple[np.ndarray, ...]]) -> str:
    """As it is defined: all arrays of all ticks, one after the other."""
    whole = hashlib.blake2b(digest_size=16)
    for state in states:
        for array in state:
            whole.update(array.tobytes())
    return whole.hexdigest()


def test_each_world_has_the_digest_of_its_states_up_to_the_tick_at_which_it_was_closed() -> None:
    rng = np.random.default_rng(0)
    position, flying, claim = np.zeros((3, 4, 2)), np.ones((3, 4), np.bool_), np.zeros((3, 4), np.int16)
    digests, states = Digests((position, flying, claim)), []
    for tick in range(150):
        position[:], flying[:], claim[:] = rng.normal(size=(3, 4, 2)), tick % 3, tick
        digests.take()
        states.append((position.copy(), flying.copy(), claim.copy()))
        if tick == 70:
            digests.close(1)
        if tick == 100:
            assert digests.of(0) == of_one([tuple(part[0] for part in state) for state in states])
    for world, ticks in enumerate((150, 71, 150)):
        assert digests.of(world) == of_one([tuple(part[world] for part in state) for state in states[:ticks]])
