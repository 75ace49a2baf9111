"""Datasets that Minari alone reads, and whose episodes their environment gives again."""

import multiprocessing
import os
import signal
import subprocess
import sys
from functools import partial
from itertools import count

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.spaces import flatten
from gymnasium.vector.utils import batch_space, iterate
from stable_baselines3 import PPO
from toys import SPACES

from curiosity_algos import NSLC, TD3ICM, CanonicalES, MAPElites
from curiosity_algos.evaluation.flat_spaces import numeric
from curiosity_algos.experiments import RunFolder, SaveRun
from curiosity_algos.experiments.export import export_minari, minari_dataset
from curiosity_gym import MazeLayout

minari = pytest.importorskip("minari")
pytestmark = pytest.mark.extra("minari")
ID = "curiosity/test-v0"

make_maze = partial(gym.make, "CuriosityMaze-US-v0", horizon=60, goal_radius=91.5)
make_pole = partial(gym.make, "CartPole-v1", max_episode_steps=30)
OWN = MazeLayout.from_ascii("S.G.\n....")
ENVS = {
    "maze": make_maze,
    "own maze": partial(gym.make, "CuriosityMaze-v0", horizon=40, layout=OWN),
    "wrapped maze": lambda: gym.wrappers.ClipReward(make_maze(), 0.0, 0.01),
    "cart pole": make_pole,
    "pendulum": partial(gym.make, "Pendulum-v1", max_episode_steps=20),
    "CuriosityControl-": partial(
        gym.make, "CuriosityControl-Finger-v0", horizon=15, random_start=True
    ),
    "CuriosityLocomotion-": partial(gym.make, "CuriosityLocomotion-AntTrap-v0", horizon=15),
}


@pytest.fixture(autouse=True)
def root(tmp_path, monkeypatch):
    """Where Minari keeps its datasets."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    return tmp_path / "datasets"


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "run"


@pytest.fixture
def export(make_model, folder):
    """Trains, and exports a sample of the policies."""

    def export(env, timesteps=150, **options):
        make_model(CanonicalES, env).learn(timesteps, SaveRun(folder))
        return export_minari(folder, ID, policies="sample", **options)

    return export


@pytest.fixture
def pole(make_model, folder):
    """A run on CartPole."""
    make_model(CanonicalES, make_pole()).learn(150, SaveRun(folder))
    return folder


def stored(folder, name):
    with np.load(RunFolder(folder).checkpoint / name) as file:
        return dict(file)


def seeds_of(dataset):
    return [each["seed"] for each in dataset.storage.get_episode_metadata(range(len(dataset)))]


def assert_is_played_again(dataset):
    """Its environment gives every bit of it."""
    env = dataset.recover_environment()
    space = numeric(env.observation_space)
    assert dataset.observation_space == space
    for episode, seed in zip(dataset, seeds_of(dataset), strict=True):
        assert episode.actions.dtype == env.action_space.dtype
        seen = [env.reset(seed=seed)[0]]
        for t, action in enumerate(episode.actions):
            observation, *others, _ = env.step(action)
            seen.append(observation)
            ends = [episode.terminations[t], episode.truncations[t]]
            assert others == [episode.rewards[t], *ends]
        assert any(ends)
        batch = batch_space(space, len(seen))
        for one, other in zip(iterate(batch, episode.observations), seen, strict=True):
            np.testing.assert_array_equal(flatten(space, one), flatten(space, other))
    env.close()


def assert_has_returns(dataset, expected):
    returns = sorted(each.rewards.sum() for each in dataset)
    np.testing.assert_allclose(returns, sorted(expected), atol=1e-6)


@pytest.mark.parametrize("name", ENVS)
def test_an_environment_gives_its_episodes_again(name, export, folder):
    dataset = export(ENVS[name]())
    sample = stored(folder, "sample.npz")
    assert sorted(seeds_of(dataset)) == sorted(sample["episode_seed"])
    assert_has_returns(dataset, sample["return"])
    assert_is_played_again(dataset)


PICTURE = spaces.Box(0, 255, (40, 40), np.uint8), spaces.Discrete(3)
"""Minari stores those of at least 32 pixels a side as JPEG by default, which loses bits."""


@pytest.mark.parametrize("name", ["bits", "discrete", "nested", "picture", "table", "texts"])
def test_other_spaces_give_their_episodes_again(name, register_toy, export, monkeypatch):
    monkeypatch.setitem(SPACES, "picture", PICTURE)
    assert_is_played_again(export(gym.make(register_toy(name)), 60))


def test_rewarding_policies(make_model, folder):
    make_model(MAPElites, make_maze()).learn(2000, SaveRun(folder))
    dataset = export_minari(folder, ID)
    assert len(dataset) > 1
    assert_has_returns(dataset, stored(folder, "rewarding.npz")["return"])


@pytest.mark.parametrize("algorithm", [MAPElites, NSLC])
def test_elites(algorithm, make_model, folder):
    model = make_model(algorithm, make_maze()).learn(1000, SaveRun(folder))
    dataset = export_minari(folder, ID, policies="elites")
    elites = model.archive.data(["objective", "seed"])
    assert len(dataset) > 1
    assert sorted(seeds_of(dataset)) == sorted(elites["seed"])
    assert_has_returns(dataset, elites["objective"])


def test_policies_are_distinct_and_so_many(pole):
    sample = stored(pole, "sample.npz")
    twice = {k: np.concatenate([v, v]) if np.ndim(v) else v for k, v in sample.items()}
    twice["episode_seed"][-1] += 1  # the same policy from another start
    np.savez(RunFolder(pole).checkpoint / "sample.npz", **twice)
    whole = export_minari(pole, ID, policies="sample")
    assert len(whole) == len(sample["return"]) + 1
    some = export_minari(pole, "curiosity/some-v0", policies="sample", n_policies=3)
    assert len(some) == 3
    assert set(seeds_of(some)) <= set(seeds_of(whole))


def test_metadata_describe_the_run(export):
    metadata = export(make_maze()).storage.metadata
    assert metadata["algorithm_name"] == "CanonicalES"
    about = metadata["run"]
    assert (about["algorithm"], about["env"]) == ("CanonicalES", "CuriosityMaze-US-v0")
    assert (about["seed"], about["env_kwargs"]["horizon"]) == (0, 60)
    assert about["settings"]["policy_kwargs"] == {"net_arch": [4]}
    assert about["versions"]["curiosity-search"]
    assert f"seed 0, after {about['timesteps']} timesteps" in metadata["description"]


READ = """
import sys
sys.modules["curiosity_gym"] = sys.modules["curiosity_algos"] = None  # not installed
import minari
dataset = minari.load_dataset(sys.argv[1])
(listed,) = minari.list_local_datasets()
print(listed, dataset.total_episodes, dataset.total_steps, dataset.env_spec.id)
"""


def test_minari_alone_reads_it(export):
    dataset = export(make_maze())
    n_steps = sum(len(each) for each in dataset)
    read = subprocess.run([sys.executable, "-c", READ, ID], capture_output=True, text=True)
    assert read.stdout == f"{ID} {len(dataset)} {n_steps} CuriosityMaze-US-v0\n", read.stderr


def test_a_spec_that_json_cannot_hold_is_left_out(export):
    env = gym.wrappers.RescaleAction(make_maze(), np.float32(-0.5), np.float32(0.5))
    dataset = export(env)
    assert dataset.env_spec is None
    assert dataset.action_space == env.action_space


def test_minaris_folder_may_be_relative(export, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "here")
    assert len(export(make_pole(), 1)) == 6
    assert (tmp_path / "here" / ID / "data").is_dir()


def test_a_kill_leaves_nothing_that_loads(pole, root, monkeypatch):
    played, episode = count(), minari_dataset._episode

    def some(*arguments):
        if next(played) == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return episode(*arguments)

    monkeypatch.setattr(minari_dataset, "_episode", some)
    arguments = {"run": pole, "dataset_id": ID, "policies": "sample"}
    fork = multiprocessing.get_context("fork")
    process = fork.Process(target=export_minari, kwargs=arguments)
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    process.close()
    (left,) = root.iterdir()
    assert left.name.startswith(".")
    assert minari.list_local_datasets() == {}
    monkeypatch.undo()
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(root))
    assert len(export_minari(pole, ID, policies="sample")) > 3


# -- refused: one sentence, and nothing is written ------------------------------------------------


@pytest.fixture
def refused(root):
    def check(match, run, dataset_id=ID, **options):
        before = sorted(root.rglob("*"))
        with pytest.raises(ValueError, match=match):
            export_minari(run, dataset_id, **options)
        assert sorted(root.rglob("*")) == before

    return check


SAMPLE = {"policies": "sample"}


@pytest.mark.parametrize(
    ("options", "match"),
    [
        *(
            ({"dataset_id": wrong}, "^`out` must be the id of a Minari dataset")
            for wrong in ("us", "../us-v0", "", "/tmp/us-v0")
        ),
        ({"policies": "best"}, "^`policies` must be one of elites, rewarding, sample"),
        ({"policies": "sample", "n_policies": 0}, "^`n_policies` must be"),
        ({"policies": "rewarding"}, "^`policies` must be a kind that the run has, it has no rew"),
        ({"policies": "elites"}, "^`policies` must be rewarding or sample"),
    ],
)
def test_wrong_arguments(options, match, make_model, folder, refused):
    make_model(CanonicalES, ENVS["pendulum"]()).learn(1, SaveRun(folder))
    refused(match, folder, **SAMPLE | options)


def test_a_dataset_that_exists(pole, refused):
    export_minari(pole, ID, policies="sample")
    refused("^`out` must be a new dataset", pole, policies="sample")


def test_endless_episodes(pole, refused, monkeypatch):
    monkeypatch.setattr(minari_dataset, "most_steps", lambda env: 2)
    refused("had not ended after 2 steps", pole, policies="sample")


@pytest.mark.filterwarnings("ignore:run.json cannot say")
def test_an_environment_that_only_python_can_give(make_model, folder, refused):
    def make_env():
        return gym.wrappers.TransformReward(make_pole(), lambda reward: 2.0 * reward)

    make_model(CanonicalES, make_env()).learn(1, SaveRun(folder))
    refused("^`env` must be given, in Python", folder, policies="sample")
    dataset = export_minari(folder, ID, policies="sample", env=make_env())
    assert all((episode.rewards == 2.0).all() for episode in dataset)


def test_damaged_samples(pole, refused):
    path = RunFolder(pole).checkpoint / "sample.npz"
    whole = stored(pole, "sample.npz")
    for damage in [
        {"parameters": whole["parameters"][:, 1:]},
        {"parameters": whole["parameters"][1:]},
        {"parameters": np.full_like(whole["parameters"], np.nan)},
        {"episode_seed": -1 - whole["episode_seed"]},
    ]:
        np.savez(path, **(whole | damage))
        refused("is damaged", pole, policies="sample")
    path.unlink()
    refused("^`folder` must be that of a run, .*sample.npz is damaged", pole, policies="sample")


def test_other_algorithms(make_model, tmp_path, refused):
    make_model(TD3ICM, ENVS["pendulum"]()).learn(40, SaveRun(tmp_path / "td3"))
    small = {"n_steps": 20, "batch_size": 20, "n_epochs": 1, "device": "cpu"}
    PPO("MlpPolicy", "CartPole-v1", **small).learn(40, SaveRun(tmp_path / "ppo"))
    for name in ("td3", "ppo"):
        refused("^`run` must be of an algorithm that evolves policies", tmp_path / name)
