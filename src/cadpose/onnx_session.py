"""How a network in an ONNX file is opened: device, threads, and no chatter on stderr."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cadpose.threads import thread_limit

#: Told of every run: the network's name and its inputs.
Watcher = Callable[[str, Mapping[str, Any]], None]
_watchers: list[Watcher] = []

#: ONNX Runtime's level for fatal errors: all others reach us as exceptions.
_FATAL = 4


class Session:
    """An ONNX Runtime session with a name, whose runs can be watched."""

    def __init__(self, session: Any, name: str) -> None:
        self._session, self._name = session, name

    def run(self, outputs: Sequence[str] | None, inputs: Mapping[str, Any]) -> list[Any]:
        """The outputs of those names; all of them if None."""
        for watcher in _watchers:
            watcher(self._name, inputs)
        answers: list[Any] = self._session.run(outputs, inputs)
        return answers

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)


@contextmanager
def watched(watcher: Watcher) -> Iterator[None]:
    """Within, a watcher is told of every run of this process, on the thread that runs it."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)


def open_session(network: Path | bytes, device: str = "cpu", threads: int = 0, name: str = "") -> Session:
    """An ONNX Runtime session.

    Args:
        network: The file, or what is in it.
        device: ``"cpu"`` or ``"cuda"``; on CUDA what it lacks runs on the CPU.
        threads: Threads within one operator; 0 takes what the process may have, see
            :mod:`cadpose.threads`, or lets ONNX Runtime choose.
        name: What a watcher is told; the file's name where there is one.

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
    session = ort.InferenceSession(
        network if isinstance(network, bytes) else str(network), options, providers=providers
    )
    return Session(session, name or ("" if isinstance(network, bytes) else network.name))
