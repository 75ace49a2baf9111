import base64
from types import SimpleNamespace

import numpy as np
import pytest

from curiosity_algos.experiments.report.curves import MOST_ROWS, curves


def unpack(packed):
    return np.frombuffer(base64.b64decode(packed["data"]), dtype=f"<{packed['kind']}")


def fake_run(values, first=None, n=10):
    x = np.linspace(0.0, 100.0, n + 1)[1:]
    log = {"timesteps": x, "seconds": x / 10, "coverage": np.full(n, values), "best_return": x * 0}
    result = {"timesteps": 100, "seconds": 10.0, "first_success_timesteps": first}
    return SimpleNamespace(
        label="A", log=log, result=result, seconds_at=lambda timesteps: timesteps / 10
    )


@pytest.fixture
def draw(maze):
    """The curves of one label with these runs."""

    class Environment:
        labels = ("A",)

        def __init__(self, runs):
            self.runs = runs

        def of(self, label):
            return self.runs

    return lambda *runs: curves(Environment(list(runs)))[0]


def test_a_mean_is_over_runs_with_an_interval(draw):
    drawn = draw(fake_run(0.2), fake_run(0.4))["coverage"]["timesteps"]
    x, mean, low, high = (unpack(drawn[name]) for name in ("x", "y", "low", "high"))
    assert (x[0], x[-1]) == (10.0, 100.0)
    np.testing.assert_allclose(mean, 0.3, rtol=1e-6)
    np.testing.assert_allclose(low, 0.2, rtol=1e-6)
    np.testing.assert_allclose(high, 0.4, rtol=1e-6)


def test_a_mean_ends_with_the_shortest_run(draw):
    short = fake_run(0.2)
    short.log = {name: values[:4] for name, values in short.log.items()}
    drawn = draw(short, fake_run(0.4))
    assert unpack(drawn["coverage"]["timesteps"]["x"])[-1] == 40.0
    assert unpack(drawn["coverage"]["seconds"]["x"])[-1] == 4.0


def test_what_is_not_counted_has_no_curve(draw):
    assert draw(fake_run(np.nan))["coverage"] == {"timesteps": None, "seconds": None}


def test_a_run_that_logged_nothing_has_no_line(draw):
    nothing = fake_run(0.5)
    nothing.log = {name: values[:0] for name, values in nothing.log.items()}
    drawn = draw(nothing)
    assert drawn["seeds"] == []
    assert drawn["best_return"]["timesteps"] is None


def test_a_long_log_is_thinned(draw):
    (seed,) = draw(fake_run(0.5, n=5000))["seeds"]
    timesteps = unpack(seed["timesteps"])
    assert len(timesteps) == MOST_ROWS
    assert timesteps[-1] == 100.0


def test_survival_lasts_to_the_end_of_the_longest_run(draw):
    drawn = draw(fake_run(0.5, first=20), fake_run(0.5))["survival"]
    assert unpack(drawn["timesteps"]["low"])[-1] > 0.0
    assert np.isnan(unpack(draw(fake_run(0.5, first=20))["survival"]["timesteps"]["high"])).all()
    for axis, times in [("timesteps", [0, 20, 100, 100]), ("seconds", [0, 2, 10, 10])]:
        assert unpack(drawn[axis]["x"]).tolist() == times
        assert unpack(drawn[axis]["y"]).tolist() == [1.0, 0.5, 0.5, 0.5]
