import gymnasium as gym
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos import (
    AURORA,
    CMAME,
    NSES,
    NSLC,
    CanonicalES,
    CuriosityES,
    MAPElites,
    load_preset,
)
from curiosity_algos.loops.presets import PRESETS

HARD = "CuriosityMaze-Hard-v0"
MAZES = ["CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", HARD]
CONTROL = [f"CuriosityControl-{name}-v0" for name in ("BallInCup", "Finger", "Stacker")]


@pytest.mark.parametrize(
    "algorithm", [CuriosityES, CanonicalES, NSES, NSLC, MAPElites, CMAME, AURORA]
)
@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("env_id", MAZES + CONTROL)
def test_every_preset_makes_a_model(algorithm, preset, env_id):
    keywords = load_preset(preset, algorithm.__name__, env_id)
    model = algorithm(env_id, **keywords)
    for name, value in keywords.items():
        assert getattr(model, name) == value


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("env_id", MAZES)
@pytest.mark.parametrize("algorithm", ["CuriosityES", "NSES", "MAPElites"])
def test_aliases_have_the_same_settings(preset, env_id, algorithm):
    alias = env_id.removeprefix("Curiosity")
    assert load_preset(preset, algorithm, alias) == load_preset(preset, algorithm, env_id)


def test_the_papers_table():
    snake, hard = (load_preset("paper", "CuriosityES", env_id) for env_id in (MAZES[0], HARD))
    assert (snake["learning_rate"], snake["bonus_kwargs"]["beta"]) == (0.5, 0.1)
    assert (hard["learning_rate"], hard["bonus_kwargs"]["beta"]) == (1.0, 0.2)
    assert {each["sigma"] for each in (snake, hard)} == {0.5}
    control = [load_preset("paper", "CuriosityES", env_id) for env_id in CONTROL]
    assert [each["sigma"] for each in control] == [0.005, 0.005, 0.001]
    assert [each["learning_rate"] for each in control] == [1.0, 0.5, 0.5]
    assert [each["n_updates"] for each in control] == [96, 96, 64]
    assert {each["gamma"] for each in control} == {0.999}
    assert {each["bonus_kwargs"]["beta"] for each in control} == {0.2}


def test_the_papers_neighbors_and_mutations():
    neighbors = [load_preset("paper", "NSES", env_id)["k"] for env_id in MAZES + CONTROL]
    assert neighbors == [20, 10, 20, 20, 10, 20]
    for algorithm in ("NSES", "MAPElites", "CMAME", "NSLC", "AURORA"):
        sigmas = [load_preset("paper", algorithm, env_id)["sigma"] for env_id in MAZES + CONTROL]
        assert sigmas == [0.5, 0.5, 0.5, 0.005, 0.005, 0.001]


def test_an_unknown_preset_is_refused():
    with pytest.raises(ValueError, match="`preset` must be one of paper, tuned"):
        load_preset("best", "CuriosityES", HARD)


def test_the_tuned_preset_is_the_default_for_every_kind_of_env():
    expected = load_preset("tuned", "CuriosityES", HARD)["learning_rate"]
    envs = [
        HARD,
        f"curiosity_gym:{HARD}",
        gym.make("Maze-Hard-v0"),
        gym.make_vec(HARD, num_envs=2),
        DummyVecEnv([lambda: gym.make(HARD)]),
    ]
    assert [CuriosityES(env).learning_rate for env in envs] == [expected] * len(envs)
    assert CuriosityES("CartPole-v1").learning_rate != expected
    assert CuriosityES(HARD, learning_rate=0.2).learning_rate == 0.2
