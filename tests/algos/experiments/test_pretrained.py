"""Policies that come with the package do what their files say."""

from importlib.resources import files

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.evaluation import evaluate_policy

from curiosity_algos.experiments.film import play
from curiosity_algos.experiments.pretrained import PRETRAINED, load_pretrained
from curiosity_algos.robust.measure import evaluate_starts

FOLDER = files("curiosity_algos").joinpath("pretrained")
US = "CuriosityMaze-US-v0"
ANT = "CuriosityLocomotion-AntTrap-v0"
ONE = "CuriosityES", "CuriosityMaze-Hard-v0"


def promised_return(algorithm, env_id):
    with np.load(FOLDER / f"{algorithm}_{env_id}.npz") as file:
        return float(file["return"])


@pytest.mark.extra("control")
def test_each_is_rewarded_as_it_was():
    searched = [each for each in PRETRAINED if each[0] != "PPO"]
    promised = {each: promised_return(*each) for each in searched}
    assert min(promised.values()) > 0.0
    assert {each: round(play(each).mean_return, 6) for each in searched} == promised


@pytest.mark.extra("locomotion")
def test_one_of_robustify_holds():
    policy = load_pretrained("ppo", ANT)
    assert evaluate_starts(policy, ANT, 10).success.sum() >= 7  # of 100 elsewhere 95 and more


def test_they_are_small():
    sizes = [len(file.read_bytes()) for file in FOLDER.iterdir()]
    assert len(sizes) == len(PRETRAINED) >= 20
    assert sum(sizes) < 5e6


def test_one_is_evaluated_as_a_model_is():
    env = gym.wrappers.TransformObservation(gym.make(ONE[1]), lambda seen: seen, None)
    policy = load_pretrained("curiosity-es", ONE[1])
    mean, _ = evaluate_policy(policy, env, n_eval_episodes=1, warn=False)
    assert mean == pytest.approx(promised_return(*ONE), abs=1e-5)


def test_an_alias_of_an_environment_will_do():
    found, expected = load_pretrained("nses", "Maze-US-v0"), load_pretrained("nses", US)
    np.testing.assert_array_equal(found.vector, expected.vector)


def test_what_is_not_there_is_said():
    for algorithm, env_id, message in [
        ("curiosity_ee", ONE[1], "did you mean CuriosityES"),
        ("curiosity_es", "CuriosityMaze-Hrd-v0", "did you mean CuriosityMaze-Hard-v0"),
        (
            "td3icm",
            ONE[1],
            "`pretrained` TD3ICM has policies for no environment, not for CuriosityMaze-Hard",
        ),
        (
            "nses",
            "CuriosityMaze-v0",
            "`pretrained` NSES has policies for CuriosityLocomotion-AntTrap-v0, ",
        ),
    ]:
        with pytest.raises(ValueError, match=message):
            load_pretrained(algorithm, env_id)
