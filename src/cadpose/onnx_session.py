"""How a network in an ONNX file is opened: device, threads, and no chatter on stderr."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cadpose.threads import thread_limit

#: ONNX Runtime's level for fatal errors: all others reach us as exceptions.
_FATAL = 4


def open_session(network: Path | bytes, device: str = "cpu", threads: int = 0) -> Any:
    """An ONNX Runtime session.

    Args:
        network: The file, or what is in it.
        device: ``"cpu"`` or ``"cuda"``; on CUDA what it lacks runs on the CPU.
        threads: Threads within one operator; 0 takes what the process may have, see
            :mod:`cadpose.threads`, or lets ONNX Runtime choose.

    Raises:
        Exception: the file cannot be run; ONNX Runtime's errors share no class of their own.
    """
    import onnxruntime as ort

    options = ort.SessionOptions()
    options.intra_op_num_threads = threads or thread_limit()
    options.log_severity_level = _FATAL
    providers = ["CPUExecutionProvider"]
    if device.startswith("cuda"):
        providers.insert(0, "CUDAExecutionProvider")
    return ort.InferenceSession(
        network if isinstance(network, bytes) else str(network), options, providers=providers
    )
