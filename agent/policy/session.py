"""The one place that runs models that are none of ours: ONNX Runtime, on one thread and without reports to its makers.

On one thread it may be open in a process that forks afterwards: what is forked shares it, weights and all. Two threads could not
be forked.
"""

import os
from collections.abc import Callable
from functools import lru_cache

# It must be said before the import, which would start a thread, keep a database and send usage reports.
os.environ["ORT_DISABLE_TELEMETRY"] = "1"

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from agent.policy.learned_kernel import Question
from agent.policy.model_file import ModelNote

Floats = NDArray[np.float32]
_OUTPUTS = ["displacement", "acceleration"]
_ROWS = 32  # asked in one call; more would no longer fit the processor's caches
_NOWHERE = "/nonexistent"  # where a model finds weights that lie in other files: what flies is what was read and hashed


@lru_cache(maxsize=4)
def open_session(data: bytes) -> onnxruntime.InferenceSession:
    """Make a model ready to run from the bytes of its file. Opened once, it is kept: drones forked afterwards share it.

    One thread in one order: its results depend on the inputs alone, and those of a row not on the rows beside it.

    Raises:
        RuntimeError: the model cannot be run; the first line says why.
    """
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    options.add_session_config_entry("session.model_external_initializers_file_folder_path", _NOWHERE)
    options.enable_cpu_mem_arena = False
    options.log_severity_level = 4  # what goes wrong is raised; nothing else is worth a line
    try:
        return onnxruntime.InferenceSession(
            data, options, providers=["CPUExecutionProvider"], enable_fallback=0, read_config_from_model=0
        )
    except Exception as error:  # its errors have no base of their own
        raise RuntimeError((str(error).splitlines() or [type(error).__name__])[0]) from None


class Session:
    """A model that ONNX Runtime runs, as agent.policy.network.Network one of ours."""

    def __init__(self, note: ModelNote, data: bytes) -> None:
        """Raises RuntimeError if it cannot be run; the first line says why."""
        self._session = open_session(data)
        self._inputs = [name for name in note.shapes if name not in _OUTPUTS]

    def plan(self, first: int, end: int, asked: Question, displacement: Floats, acceleration: Floats) -> None:
        """As `Network.plan`."""
        for begin in range(first, end, _ROWS):
            rows = slice(begin, min(begin + _ROWS, end))
            planned = self._session.run(_OUTPUTS, {name: getattr(asked, name)[rows] for name in self._inputs})
            for out, plans in zip((displacement, acceleration), planned, strict=True):
                out[begin - first : begin - first + len(plans)] = plans

    def bound(self, asked: Question, displacement: Floats, acceleration: Floats) -> Callable[[], None]:
        """As `Network.bound`."""
        binding = self._session.io_binding()
        for name in self._inputs:
            array = getattr(asked, name)[:1]
            binding.bind_input(name, "cpu", 0, array.dtype.type, array.shape, array.ctypes.data)
        for name, array in zip(_OUTPUTS, (displacement, acceleration), strict=True):
            binding.bind_output(name, "cpu", 0, array.dtype.type, array.shape, array.ctypes.data)

        def call() -> None:
            self._session.run_with_iobinding(binding)

        vars(call)["bound"] = asked, displacement, acceleration  # live as long
        return call
