import io
import sys

import pytest

from curiosity_algos.cli.many import train_all
from curiosity_algos.experiments.training import RunSpec


class Screen(io.StringIO):
    def isatty(self):
        return True


def test_a_bar_counts_runs_and_failures_are_told_at_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Screen())
    runs = [RunSpec("NSES", "CuriosityMaze-US-v0", seed, 1000) for seed in range(3)]

    def backend(runs, train, report):
        for run, outcome in zip(runs, (False, OSError("disk full"), False), strict=True):
            report(run, outcome)

    with pytest.raises(ValueError, match=r"^1 of 3 runs failed: .*/1: disk full$"):
        train_all(runs, tmp_path, backend=backend)
    assert "3/3" in sys.stderr.getvalue()
