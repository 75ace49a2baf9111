"""A run for a sweep's backend that takes a while, and leaves a file when it begins."""

import time


def touch(path):
    path.touch()
    time.sleep(1.0)
    return True
