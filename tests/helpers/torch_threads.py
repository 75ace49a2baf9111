"""On how many threads torch computes."""

from contextlib import contextmanager

import torch as th
from torch.overrides import TorchFunctionMode

HEAVY = {"addmm", "backward", "cdist", "conv2d", "linear", "matmul", "mm", "mse_loss"}


class _Watch(TorchFunctionMode):
    def __init__(self):
        super().__init__()
        self.threads = set()

    def __torch_function__(self, function, types, args=(), kwargs=None):
        if function.__name__ in HEAVY:
            self.threads.add(th.get_num_threads())
        return function(*args, **(kwargs or {}))


@contextmanager
def heavy_threads():
    """The numbers of threads that torch was set to in what is expensive; it is set to two."""
    before = th.get_num_threads()
    th.set_num_threads(2)
    try:
        with _Watch() as watch:
            yield watch.threads
        assert th.get_num_threads() == 2
    finally:
        th.set_num_threads(before)
