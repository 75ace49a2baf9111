"""Stable-Baselines3's own tools work on every algorithm of this package."""

import numpy as np
import pytest
from stable_baselines3.common.callbacks import (
    CheckpointCallback,
    EvalCallback,
    StopTrainingOnNoModelImprovement,
    StopTrainingOnRewardThreshold,
)
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.logger import configure
from stable_baselines3.common.monitor import Monitor

from curiosity_algos import TD3ICM


@pytest.fixture
def interval(any_algorithm):
    """Calls of a callback between two that do something: steps of TD3, generations of others."""
    return 64 if any_algorithm is TD3ICM else 1


def test_policies_are_evaluated(any_algorithm, make_model, make_easy_maze):
    env = Monitor(make_easy_maze())
    model = make_model(any_algorithm, env).learn(600)
    returns, lengths = evaluate_policy(model, env, n_eval_episodes=2, return_episode_rewards=True)
    assert returns == [1.0 - lengths[0] / 64 if lengths[0] < 64 else 0.0] * 2


def test_training_stops_when_nothing_improves(
    any_algorithm, interval, make_model, make_maze, tmp_path
):
    after = StopTrainingOnNoModelImprovement(max_no_improvement_evals=2, min_evals=1)
    callback = EvalCallback(
        Monitor(make_maze()),
        callback_after_eval=after,
        n_eval_episodes=1,
        eval_freq=interval,
        best_model_save_path=str(tmp_path),
        log_path=str(tmp_path),
        verbose=0,
    )
    model = make_model(any_algorithm, make_maze())  # its goal is out of reach
    model.learn(1e9, callback=callback)
    assert callback.n_calls == 4 * interval
    assert any_algorithm.load(tmp_path / "best_model").num_timesteps < model.num_timesteps
    assert np.load(tmp_path / "evaluations.npz")["results"].tolist() == [[0.0]] * 4


def test_training_stops_at_a_reward(any_algorithm, interval, make_model, make_easy_maze):
    callback = EvalCallback(
        Monitor(make_easy_maze()),
        callback_on_new_best=StopTrainingOnRewardThreshold(0.0, verbose=0),
        n_eval_episodes=1,
        eval_freq=interval,
        verbose=0,
    )
    model = make_model(any_algorithm, make_easy_maze())
    model.learn(1e9, callback=callback)
    assert callback.n_calls == interval


def test_checkpoints_are_loadable(any_algorithm, interval, make_model, make_easy_maze, tmp_path):
    callback = CheckpointCallback(interval, str(tmp_path), save_replay_buffer=True)
    make_model(any_algorithm, make_easy_maze()).learn(600, callback=callback)
    paths = list(tmp_path.glob("rl_model_*_steps.zip"))
    assert len(paths) > 1
    for path in paths:
        assert f"_{any_algorithm.load(path).num_timesteps}_" in path.name


def test_logs_go_where_they_are_sent(any_algorithm, make_model, make_easy_maze, tmp_path):
    model = make_model(any_algorithm, make_easy_maze())
    model.set_logger(configure(str(tmp_path), ["csv", "json"]))
    model.learn(600, log_interval=1)
    assert {path.name for path in tmp_path.iterdir()} == {"progress.csv", "progress.json"}


def test_tensorboard_gets_a_folder_for_each_run(any_algorithm, make_model, make_maze, tmp_path):
    pytest.importorskip("tensorboard")
    model = make_model(any_algorithm, make_maze(), tensorboard_log=str(tmp_path))
    model.learn(1)
    model.learn(1)
    name = any_algorithm.__name__
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}_1", f"{name}_2"}


def test_no_log_interval_is_no_log(any_algorithm, make_model, make_easy_maze, capsys):
    make_model(any_algorithm, make_easy_maze(), verbose=1).learn(300, log_interval=None)
    assert "total_timesteps" not in capsys.readouterr().out
