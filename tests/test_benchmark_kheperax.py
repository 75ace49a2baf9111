"""The benchmark on Kheperax's maze, beside Kheperax's own functions."""

import numpy as np
import pandas as pd
import pytest
import typer

from benchmarks import kheperax, kheperax_maze
from benchmarks.kheperax_maze import MLP, Record
from curiosity_algos.evaluation.mlp import act


@pytest.fixture(scope="module")
def played():
    """Tasks, parameters (3, 138) and their rollouts."""
    pytest.importorskip("kheperax")
    parameters = np.random.default_rng(0).normal(0.0, 0.5, (3, 138)).astype(np.float32)
    record = Record(3)
    return record, parameters, kheperax_maze.KheperaxEvaluator(record).evaluate(parameters)


def test_policies_have_as_many_weights_as_those_of_pyribs():
    assert MLP.n_parameters == 138


def test_rollouts_are_steps_of_kheperax(played):
    import jax

    record, parameters, rollouts = played
    task = kheperax_maze.make_task()
    step = jax.jit(task.step)
    observations, actions = rollouts.trajectories
    assert observations.shape == (3, 251, 5)
    for i, lengths in enumerate(rollouts.lengths):
        state = task.reset(jax.random.PRNGKey(i))
        for t in range(lengths):
            before = state.info["state_descriptor"]
            np.testing.assert_allclose(state.obs, observations[i, t], atol=1e-3)
            chosen = act(MLP, parameters[i : i + 1], observations[i : i + 1, t])[0]
            np.testing.assert_allclose(actions[i, t], chosen, atol=1e-5)
            state = step(state, actions[i, t])
        np.testing.assert_allclose(rollouts.behaviors[i], before, atol=1e-3)
    assert record.coverage() == share_of_cells(rollouts.behaviors)


def test_an_episode_ends_at_the_target(monkeypatch):
    pytest.importorskip("kheperax")
    task = kheperax_maze.make_task()
    task.kheperax_config.target_pos = (0.15, 0.3)  # straight ahead of the start
    monkeypatch.setattr(kheperax_maze, "make_task", lambda: task)
    parameters = np.zeros((1, 138), dtype=np.float32)
    parameters[0, -2:] = 0.1  # biases of the wheels
    rollouts = kheperax_maze.KheperaxEvaluator(Record(1)).evaluate(parameters)
    n_steps = int(np.ceil((0.15 - task.kheperax_config.target_radius) / (np.tanh(0.1) * 0.025)))
    assert rollouts.lengths.tolist() == [n_steps]
    assert rollouts.terminated.tolist() == [True]
    # Kheperax's descriptor is the position before the last step, outside the target.
    before = 0.15 + (n_steps - 1) * np.tanh(0.1) * 0.025
    np.testing.assert_allclose(rollouts.behaviors, [[0.15, before]], atol=1e-5)


def share_of_cells(behaviors):
    """Coverage without the benchmark's code; a robot in a wall counts for the cell beside it."""
    counts, _, _ = np.histogram2d(*behaviors.clip(0.0, 1.0).T, bins=100, range=[[0.0, 1.0]] * 2)
    return np.count_nonzero(counts) / counts.size


def test_coverage_counts_cells_in_the_order_of_episodes():
    behaviors = np.random.default_rng(1).beta(2.0, 2.0, (5000, 2))
    record = Record(4000)
    for part in np.split(behaviors, 50):
        record.add(part)
    assert record.is_full
    assert record.coverage() == share_of_cells(behaviors[:4000])
    for row in kheperax.curve(record, "CuriosityES", 0):
        within = behaviors[: row["steps"] // 250]
        assert row["coverage"] == share_of_cells(within)


def test_names_are_checked_first():
    with pytest.raises(typer.BadParameter, match="The name is one of CuriosityES, NSLC, learned"):
        kheperax.main("Nses", 0)


@pytest.mark.parametrize("name", kheperax.SEARCHES)
@pytest.mark.nightly
def test_a_run_spends_its_budget_and_is_kept(name, tmp_path):
    pytest.importorskip("kheperax")
    kheperax.main(name, 100, steps=400 * 250, out=tmp_path)
    (row,) = pd.read_csv(tmp_path / "kheperax.csv").to_dict("records")
    assert (row["algorithm"], row["seed"], row["steps"]) == (name, 100, 100_000)
    curve = pd.read_csv(tmp_path / "kheperax_curves.csv")
    assert curve["steps"].tolist() == list(range(1000, 100_001, 1000))
    assert curve["coverage"].is_monotonic_increasing
    assert curve["coverage"].iloc[-1] == row["coverage"] > 0.0


def test_the_table_has_the_published_run_beside_the_others(tmp_path):
    rows = [("NSES", seed, 93.75e6, 0.5 + seed / 10, 375) for seed in range(3)]
    rows += [("CuriosityES", 0, 9.375e6, 0.3, 93.75), ("NSLC, learned", 0, 9.375e6, 0.2, np.nan)]
    columns = ["algorithm", "seed", "steps", "coverage", "seconds"]
    runs = pd.DataFrame(rows, columns=columns)
    curves = pd.concat([runs, runs[:3].assign(steps=9.375e6, coverage=0.25)])
    for name, values in {"kheperax": runs, "kheperax_curves": curves}.items():
        values.to_csv(tmp_path / f"{name}.csv", index=False)
    assert kheperax.table(tmp_path).splitlines()[2:] == [
        "| pyribs, as its page reports | yes |  | 88.9 |  |",
        "| NSES | yes | 25.0 (25.0 to 25.0) | 60.0 (50.0 to 70.0) | 4.0 |",
        "| CuriosityES | no | 30.0 |  | 10.0 |",
        "| NSLC, learned | no | 20.0 |  |  |",
    ]
