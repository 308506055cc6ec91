"""What runs in a worker process of the pool: load the models once, then photo by photo.

Nothing heavy is imported with this module: the process first learns how many threads it may have.
"""

from __future__ import annotations

import logging
import os
import signal
import threading
from multiprocessing import parent_process
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from cadpose.batch.job import Job
    from cadpose.batch.messages import Message


def serve(connection: Connection, job_bytes: bytes, threads: int, level: int) -> None:
    """Annotate the photos that come through the connection until None comes or the parent has gone.

    Args:
        connection: To the parent.
        job_bytes: The pickled :class:`cadpose.batch.job.Job`.
        threads: Threads that this process may compute with.
        level: From which level on log records are passed on.
    """
    # Ctrl-C in a terminal reaches every process; the parent alone answers it.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()

    from cadpose.threads import limit_threads

    limit_threads(threads)

    import pickle

    from cadpose.batch.messages import Broken, Done, Ready
    from cadpose.errors import CadposeError

    speak = _Speaker(connection)
    _pass_logs_on(speak, level)
    try:
        job: Job = pickle.loads(job_bytes)  # made by our own parent a moment ago
        worker = job.open()
        speak(Ready(worker.making))
        while (task := connection.recv()) is not None:
            speak(Done(worker.annotate(task)))
    except (EOFError, BrokenPipeError):
        return  # the parent has gone
    except CadposeError as error:
        speak(Broken(type(error).__name__, str(error)))
    except Exception as error:
        logging.getLogger(__name__).debug("the worker failed", exc_info=True)
        speak(Broken(type(error).__name__, str(error)))


class _Speaker:
    """Sends messages of several threads one after the other."""

    def __init__(self, connection: Connection) -> None:
        self._connection, self._lock = connection, threading.Lock()

    def __call__(self, message: Message) -> None:
        with self._lock:
            self._connection.send(message)


def _end_with_parent() -> None:
    """A worker whose parent was killed ends at once: the next run may take up its photo."""
    parent = parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)


def _pass_logs_on(speak: _Speaker, level: int) -> None:
    from cadpose.batch.messages import logged

    class ToParent(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            try:
                speak(logged(record))
            except (OSError, ValueError):
                self.handleError(record)

    logging.basicConfig(level=logging.WARNING, handlers=[ToParent()], force=True)
    logging.getLogger("cadpose").setLevel(level)
