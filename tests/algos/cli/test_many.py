import io
import sys

import pytest

from curiosity_algos.cli import many
from curiosity_algos.cli.many import SweepBars
from curiosity_algos.experiments.training import RunSpec


class Screen(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def runs():
    return [RunSpec("NSES", "Maze-US-v0", seed, 1000) for seed in range(3)]


@pytest.fixture
def log(runs, tmp_path):
    """Writes the log of a run that is so far."""

    def log(seed, timesteps):
        path = runs[seed].folder(tmp_path)
        path.mkdir(parents=True, exist_ok=True)
        (path / "progress.csv").write_text(f"time/total_timesteps,a\n1,2\n{timesteps},0.5\n99")

    return log


def test_each_run_has_a_bar_and_the_whole_has_one(runs, log, tmp_path, monkeypatch, capsys):
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(many, "SECONDS", 1e9)  # shown when asked to
    log(2, 800)  # before the sweep began
    with SweepBars(runs, tmp_path) as bars:
        log(0, 300)
        log(1, 300)
        bars.show()
        assert sorted(abs(bar.pos) for bar in bars._bars.values()) == [1, 2]
        bars.end(runs[0], "the first is done")
        log(2, 1200)  # beyond the budget, as the last generation goes
        log(1, 700)
        bars.show()
        assert sorted(abs(bar.pos) for bar in bars._bars.values()) == [1, 2]
        assert [bar.n for bar in bars._bars.values()] == [700, 1000]
        for run in runs[1:]:
            bars.end(run)
        assert not bars._bars
    text = screen.getvalue()
    assert "NSES Maze-US-v0 0" in text
    assert "3/3" in text
    assert "the first is done" in capsys.readouterr().out


def test_it_looks_by_itself(runs, log, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Screen())
    monkeypatch.setattr(many, "SECONDS", 0.01)
    with SweepBars(runs, tmp_path) as bars:
        log(0, 300)
        while not bars._bars:
            pass
        assert [bar.n for bar in bars._bars.values()] == [300]


def test_elsewhere_there_is_none(runs, log, tmp_path, capsys):
    with SweepBars(runs, tmp_path) as bars:
        log(0, 300)
        bars.end(runs[0], "done")
    assert capsys.readouterr() == ("done\n", "")
