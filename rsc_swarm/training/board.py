"""The curves of a training for TensorBoard: a file ``events.*`` of records.

TensorBoard's own writer writes them in a thread, which answers a full disk with a traceback of its own, and much later.
"""

import os
import socket
import time
from pathlib import Path

from tensorboard.compat.proto.event_pb2 import Event, SessionLog
from tensorboard.compat.proto.summary_pb2 import Summary
from tensorboard.summary.writer.record_writer import RecordWriter

from protocols.closing import Closing
from protocols.whole_file import WriteError
from rsc_swarm.training.watcher import Scalars


class Board(Closing):
    """One file of them."""

    def __init__(self, folder: Path, epoch: int) -> None:
        """Begin one in ``folder``; what others there say of ``epoch`` and later is not shown any more.

        Raises:
            WriteError: it cannot be written.
        """
        now = time.time()
        self._path = folder / f"events.out.tfevents.{now:.0f}.{socket.gethostname()}.{os.getpid()}"
        try:
            self._file = self._path.open("wb", buffering=0)
        except OSError as error:
            raise self._unwritten(error) from None
        self._records = RecordWriter(self._file)
        self._write(
            Event(wall_time=now, file_version="brain.Event:2"),
            Event(wall_time=now, step=epoch, session_log=SessionLog(status=SessionLog.START)),
        )

    def add(self, epoch: int, scalars: Scalars) -> None:
        """Write the scalars of an epoch.

        Raises:
            WriteError: it cannot be written.
        """
        values = [Summary.Value(tag=name, simple_value=value) for name, value in scalars.items()]
        self._write(Event(wall_time=time.time(), step=epoch, summary=Summary(value=values)))

    def close(self) -> None:
        self._file.close()

    def _write(self, *events: Event) -> None:
        try:
            for event in events:
                self._records.write(event.SerializeToString())
        except OSError as error:
            raise self._unwritten(error) from None

    def _unwritten(self, error: OSError) -> WriteError:
        return WriteError(f"{self._path}: cannot be written ({error.strerror})")
