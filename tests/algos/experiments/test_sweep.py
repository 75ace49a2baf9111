from curiosity_algos.experiments.sweep import grid, sweep
from curiosity_algos.experiments.training import train

SETTINGS = {"population_size": 6, "policy_kwargs": {"net_arch": [4]}}


def test_a_sweep_has_no_run_twice():
    runs = grid(["nses", "NS_ES"], ["a-v0", "a-v0"], [0, 1, 0], timesteps=1)
    assert [(run.algorithm, run.seed) for run in runs] == [("NSES", 0), ("NSES", 1)]


def test_it_tells_how_far_runs_are_and_how_they_ended(tmp_path):
    runs = grid(
        ["map_elites"],
        ["CuriosityMaze-US-v0"],
        [0, 1, 2],
        timesteps=1200,
        env_kwargs={"horizon": 50},
        settings=SETTINGS,
    )
    train(runs[2], runs[2].folder(tmp_path))
    told, ended = [], {}
    sweep(
        runs,
        tmp_path,
        jobs=1,
        report=lambda run, outcome: ended.update({run.seed: outcome}),
        advance=lambda run, timesteps: told.append((run.seed, timesteps, set(ended))),
    )
    assert ended == {0: True, 1: True, 2: False}
    assert {seed for seed, _, _ in told} == {0, 1}
    for seed, timesteps, before in told:
        assert 0 < timesteps <= 1200
        assert seed not in before
