import io
import sys

from curiosity_algos.cli.bars import SweepBars
from curiosity_algos.experiments.training import RunSpec


class Screen(io.StringIO):
    def isatty(self):
        return True


def test_each_run_has_a_bar_and_the_whole_has_one(monkeypatch, capsys):
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    runs = [RunSpec("NSES", "Maze-US-v0", seed, 1000) for seed in range(3)]
    with SweepBars(3) as bars:
        for run in runs[:2]:
            bars.advance(run, 300)
        assert sorted(abs(bar.pos) for bar in bars._bars.values()) == [1, 2]
        bars.end(runs[0], "the first is done")
        bars.advance(runs[2], 1200)  # beyond the budget, as the last generation goes
        assert sorted(abs(bar.pos) for bar in bars._bars.values()) == [1, 2]
        bars.advance(runs[1], 700)
        assert [bar.n for bar in bars._bars.values()] == [700, 1000]
        for run in runs[1:]:
            bars.end(run)
        assert not bars._bars
    text = screen.getvalue()
    assert "NSES Maze-US-v0 0" in text
    assert "3/3" in text
    assert "the first is done" in capsys.readouterr().out


def test_elsewhere_there_is_none(capsys):
    run = RunSpec("NSES", "Maze-US-v0", 0, 1000)
    with SweepBars(1) as bars:
        bars.advance(run, 300)
        bars.end(run, "done")
    assert capsys.readouterr() == ("done\n", "")
