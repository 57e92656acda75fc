"""Rows of arrays as the bytes they are made of."""

import os

import numpy as np
import psutil

from protocols.wire.rows import room


def test_room_takes_memory_only_where_it_is_written_to() -> None:
    weigh = psutil.Process().memory_info
    before = weigh().rss
    rows = room((1 << 20, 8), np.float64)
    taken = weigh().rss - before
    rows[:] = 1.0
    assert taken < 1e6 < 6e7 < weigh().rss - before


def test_room_begins_as_zeros_and_what_a_forked_process_writes_there_is_its_own() -> None:
    rows = room((3, 2), np.int16)
    assert rows.tolist() == [[0, 0]] * 3
    pid = os.fork()
    if pid == 0:
        rows[:] = 7
        os._exit(int(rows[0, 0]))
    assert os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) == 7
    assert not rows.any()


def test_room_for_no_rows_is_empty() -> None:
    assert room((0, 4), np.float32).shape == (0, 4)
