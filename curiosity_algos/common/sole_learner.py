"""One model learns at a time in a process, as it borrows what the whole process has only once."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

_LEARNS = threading.RLock()


@contextmanager
def sole_learner() -> Iterator[None]:
    """Keep models of other threads from learning until the block ends.

    A thread may enter again, so that callbacks can train, load and evaluate models.

    Raises:
        RuntimeError: If a model learns in another thread: global generators and threads of the
            libraries are the process', so that neither run would be the one it is alone.
    """
    if not _LEARNS.acquire(blocking=False):
        raise RuntimeError(
            "One model learns at a time in a process, and another thread's does: use processes, "
            "such as `curiosity sweep`."
        )
    try:
        yield
    finally:
        _LEARNS.release()
