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
OWN = MazeLayout.from_ascii("S.G.\n....")
ENVS = {
    "maze": make_maze,
    "own maze": partial(gym.make, "CuriosityMaze-v0", horizon=40, layout=OWN),
    "limited maze": partial(gym.make, "CuriosityMaze-US-v0", max_episode_steps=25),
    "wrapped maze": lambda: gym.wrappers.ClipReward(make_maze(), 0.0, 0.01),
    "cart pole": partial(gym.make, "CartPole-v1", max_episode_steps=30),
    "pendulum": partial(gym.make, "Pendulum-v1", max_episode_steps=20),
}
EXTRAS = {
    "CuriosityControl-Finger-v0": {"horizon": 15, "random_start": True},
    "CuriosityLocomotion-Ant-v0": {"horizon": 20},
    "CuriosityLocomotion-AntTrap-v0": {"horizon": 15},
    "CuriosityLocomotion-Hopper-v0": {"horizon": 30},
}


@pytest.fixture(autouse=True)
def root(tmp_path, monkeypatch):
    """Where Minari keeps its datasets."""
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path / "datasets"))
    return tmp_path / "datasets"


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "run"


def train(make_model, env, folder, timesteps=400, algorithm=CanonicalES, **saved):
    return make_model(algorithm, env).learn(timesteps, SaveRun(folder, **saved))


def kept(folder, name):
    with np.load(RunFolder(folder).checkpoint / name) as file:
        return dict(file)


def seeds_of(dataset):
    metadata = dataset.storage.get_episode_metadata(range(len(dataset)))
    return [each["seed"] for each in metadata]


def assert_is_played_again(dataset):
    """Its environment gives every bit of it."""
    env = dataset.recover_environment()
    for episode, seed in zip(dataset, seeds_of(dataset), strict=True):
        observation, _ = env.reset(seed=seed)
        assert episode.observations.dtype == dataset.observation_space.dtype
        assert episode.actions.dtype == dataset.action_space.dtype
        np.testing.assert_array_equal(observation, episode.observations[0])
        assert len(episode.observations) == len(episode.actions) + 1 == len(episode.rewards) + 1
        for t, action in enumerate(episode.actions):
            assert dataset.action_space.contains(action)
            observation, *others, _ = env.step(action)
            np.testing.assert_array_equal(observation, episode.observations[t + 1])
            ends = (episode.terminations[t], episode.truncations[t])
            assert others == [episode.rewards[t], *ends]
        assert any(ends)
    env.close()


def assert_is_sample(dataset, folder):
    """It is what the run kept, with the returns that it had there."""
    sample = kept(folder, "sample.npz")
    returns = [each.rewards.sum() for each in dataset]
    order = np.lexsort([returns, seeds_of(dataset)])
    expected = np.lexsort([sample["return"], sample["episode_seed"]])
    np.testing.assert_array_equal(
        np.array(seeds_of(dataset))[order], sample["episode_seed"][expected]
    )
    np.testing.assert_allclose(np.array(returns)[order], sample["return"][expected], atol=1e-6)


def assert_is_given_again(dataset):
    """As `assert_is_played_again`, of observations that need not be arrays."""
    env = dataset.recover_environment()
    space = numeric(env.observation_space)
    assert dataset.observation_space == space
    for episode, seed in zip(dataset, seeds_of(dataset), strict=True):
        n_steps = len(episode.rewards)
        seen = [*iterate(batch_space(space, n_steps + 1), episode.observations)]
        given = [env.reset(seed=seed)[0]]
        for t in range(n_steps):
            observation, reward, *_ = env.step(episode.actions[t])
            given.append(observation)
            assert reward == episode.rewards[t]
        for one, other in zip(seen, given, strict=True):
            np.testing.assert_array_equal(flatten(space, one), flatten(space, other))


@pytest.mark.parametrize("make_env", ENVS.values(), ids=ENVS)
def test_an_environment_gives_its_episodes_again(make_env, make_model, folder):
    train(make_model, make_env(), folder)
    dataset = export_minari(folder, ID, policies="sample")
    assert len(dataset) > 6
    assert_is_sample(dataset, folder)
    assert_is_played_again(dataset)


@pytest.mark.parametrize("env_id", EXTRAS)
def test_an_environment_of_an_extra_gives_its_episodes_again(env_id, make_model, folder):
    pytest.importorskip("mujoco")
    train(make_model, gym.make(env_id, **EXTRAS[env_id]), folder, 150)
    dataset = export_minari(folder, ID, policies="sample")
    assert len(set(seeds_of(dataset))) > 1
    assert_is_sample(dataset, folder)
    assert_is_played_again(dataset)


@pytest.mark.parametrize("name", SPACES)
def test_an_environment_of_other_spaces_gives_its_episodes_again(
    name, register_toy, make_model, folder
):
    train(make_model, gym.make(register_toy(name)), folder, 60)
    assert_is_given_again(export_minari(folder, ID, policies="sample"))


def test_images_lose_no_bits(register_toy, make_model, folder, monkeypatch):
    """Minari keeps those of at least 32 pixels a side as JPEG, if it is let."""
    picture = spaces.Box(0, 255, (40, 40), np.uint8), spaces.Discrete(3)
    monkeypatch.setitem(SPACES, "picture", picture)
    train(make_model, gym.make(register_toy("picture")), folder, 60)
    assert_is_given_again(export_minari(folder, ID, policies="sample"))


def test_gymnasiums_own_robots_give_their_episodes_again(make_model, folder):
    pytest.importorskip("mujoco")
    train(make_model, gym.make("Hopper-v5", max_episode_steps=15), folder, 150)
    dataset = export_minari(folder, ID, policies="sample")
    assert_is_sample(dataset, folder)
    assert_is_played_again(dataset)


def test_a_run_in_a_vector_entry_gives_its_episodes_again(make_model, folder):
    envs = gym.make_vec("CartPole-v1", num_envs=4, vectorization_mode="vector_entry_point")
    train(make_model, envs, folder, 150)
    assert_is_played_again(export_minari(folder, ID, policies="sample"))


def test_ends_are_told_apart(make_model, folder):
    train(make_model, ENVS["maze"](), folder)
    for episode in export_minari(folder, ID, policies="sample"):
        assert not episode.terminations[:-1].any()
        assert not episode.truncations[:-1].any()
        succeeded = episode.rewards[-1] > 0.0
        assert episode.terminations[-1] == succeeded != episode.truncations[-1]


def test_the_rewarding_ones_are_rewarded(make_model, folder):
    train(make_model, ENVS["maze"](), folder, 2000, MAPElites)
    dataset = export_minari(folder, ID)
    rewarding = kept(folder, "rewarding.npz")
    assert len(dataset) == len(rewarding["return"]) > 1
    returns = sorted(each.rewards.sum() for each in dataset)
    np.testing.assert_allclose(returns, sorted(rewarding["return"]), atol=1e-6)


@pytest.mark.parametrize("algorithm", [MAPElites, NSLC])
def test_the_elites(algorithm, make_model, folder):
    model = train(make_model, ENVS["maze"](), folder, 1000, algorithm)
    dataset = export_minari(folder, ID, policies="elites")
    elites = model.archive.data(["objective", "seed"])
    assert len(dataset) == len(model.archive) > 1
    assert sorted(seeds_of(dataset)) == sorted(elites["seed"])
    returns = sorted(each.rewards.sum() for each in dataset)
    np.testing.assert_array_equal(returns, sorted(elites["objective"]))


def test_of_many_some_are_drawn(make_model, folder):
    train(make_model, ENVS["cart pole"](), folder)
    dataset = export_minari(folder, ID, policies="sample", n_policies=3)
    assert len(dataset) == 3
    assert set(seeds_of(dataset)) <= set(kept(folder, "sample.npz")["episode_seed"].tolist())


def test_one_that_is_there_twice_is_played_once(make_model, folder):
    train(make_model, ENVS["cart pole"](), folder)
    sample = kept(folder, "sample.npz")
    n = len(sample["return"])
    twice = {k: np.concatenate([v, v]) if np.ndim(v) else v for k, v in sample.items()}
    twice["episode_seed"][-1] += 1  # the same policy from another start
    np.savez(RunFolder(folder).checkpoint / "sample.npz", **twice)
    assert len(export_minari(folder, ID, policies="sample")) == n + 1


def test_it_says_what_the_run_was(make_model, folder):
    model = train(make_model, ENVS["maze"](), folder)
    metadata = export_minari(folder, ID, policies="sample").storage.metadata
    assert metadata["algorithm_name"] == "CanonicalES"
    about = metadata["run"]
    assert (about["algorithm"], about["env"]) == ("CanonicalES", "CuriosityMaze-US-v0")
    assert (about["seed"], about["timesteps"]) == (0, model.num_timesteps)
    assert about["settings"]["policy_kwargs"] == {"net_arch": [4]}
    assert about["versions"]["curiosity-search"]
    assert about["env_kwargs"]["horizon"] == 60
    assert not {"author", "author_email", "code_permalink"} & metadata.keys()
    assert "CanonicalES on CuriosityMaze-US-v0, seed 0" in metadata["description"]


READ = """
import sys
sys.modules["curiosity_gym"] = sys.modules["curiosity_algos"] = None  # not installed
import minari
dataset = minari.load_dataset(sys.argv[1])
(listed,) = minari.list_local_datasets()
episode = dataset[0]
print(listed, dataset.total_episodes, dataset.total_steps, repr(episode)[:11], dataset.env_spec.id)
"""


def test_minari_alone_reads_it(make_model, folder):
    train(make_model, ENVS["maze"](), folder)
    dataset = export_minari(folder, ID, policies="sample")
    n_steps = sum(len(each) for each in dataset)
    read = subprocess.run([sys.executable, "-c", READ, ID], capture_output=True, text=True)
    expected = f"{ID} {len(dataset)} {n_steps} EpisodeData CuriosityMaze-US-v0\n"
    assert (read.stdout, read.returncode) == (expected, 0), read.stderr


def test_a_spec_that_is_no_json_is_left_out(make_model, folder):
    env = gym.wrappers.RescaleAction(make_maze(), np.float32(-0.5), np.float32(0.5))
    train(make_model, env, folder)
    dataset = export_minari(folder, ID, policies="sample")
    assert dataset.env_spec is None
    assert dataset.action_space == env.action_space
    assert_is_sample(dataset, folder)


def test_minaris_folder_may_be_named_from_here(make_model, folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", "here")
    train(make_model, ENVS["cart pole"](), folder, 1)
    assert len(export_minari(folder, ID, policies="sample")) == 6
    assert (tmp_path / "here" / ID / "data").is_dir()


class TestWhole:
    """A dataset is there once it is whole."""

    @pytest.fixture
    def run(self, make_model, folder):
        train(make_model, ENVS["cart pole"](), folder)
        return folder

    def cut(self, monkeypatch, end):
        """Let `end` happen once three episodes are written."""
        played, episode = count(), minari_dataset._episode

        def some(*arguments):
            if next(played) == 3:
                end()
            return episode(*arguments)

        monkeypatch.setattr(minari_dataset, "_episode", some)

    def test_ctrl_c_leaves_nothing(self, run, root, monkeypatch):
        def press():
            raise KeyboardInterrupt

        self.cut(monkeypatch, press)
        with pytest.raises(KeyboardInterrupt):
            export_minari(run, ID, policies="sample")
        assert list(root.iterdir()) == []

    def test_a_kill_leaves_nothing_that_loads(self, run, root, monkeypatch):
        with monkeypatch.context() as patch:
            self.cut(patch, lambda: os.kill(os.getpid(), signal.SIGKILL))
            arguments = {"run": run, "dataset_id": ID, "policies": "sample"}
            process = multiprocessing.get_context("fork").Process(
                target=export_minari, kwargs=arguments
            )
            process.start()
            process.join()
            assert process.exitcode == -signal.SIGKILL
            process.close()
        (left,) = root.iterdir()
        assert left.name.startswith(".")
        assert minari.list_local_datasets() == {}
        with pytest.raises(FileNotFoundError):
            minari.load_dataset(ID)
        assert len(export_minari(run, ID, policies="sample")) > 3


def test_endless_episodes_are_refused(make_model, folder, monkeypatch):
    train(make_model, ENVS["pendulum"](), folder, 1)
    monkeypatch.setattr(minari_dataset, "most_steps", lambda env: 19)
    with pytest.raises(ValueError, match="had not ended after 19 steps"):
        export_minari(folder, ID, policies="sample")
    assert minari.list_local_datasets() == {}


class TestRefused:
    """One sentence, and nothing is written."""

    @pytest.fixture
    def refused(self, root):
        def check(match, *arguments, **keywords):
            before = sorted(root.rglob("*"))
            with pytest.raises(ValueError, match=match):
                export_minari(*arguments, **keywords)
            assert sorted(root.rglob("*")) == before

        return check

    @pytest.fixture
    def run(self, make_model, folder):
        train(make_model, ENVS["cart pole"](), folder, 1)
        return folder

    @pytest.mark.parametrize("wrong", ["us", "../us-v0", "us-v", "", "a b-v0", "/tmp/us-v0"])
    def test_no_id(self, wrong, run, refused):
        refused("^`out` must be the id of a Minari dataset", run, wrong, policies="sample")

    def test_a_dataset_that_is_there(self, run, refused):
        export_minari(run, ID, policies="sample")
        refused("^`out` must be a new dataset", run, ID, policies="sample")

    def test_no_such_policies(self, run, refused):
        refused("^`policies` must be one of elites, rewarding, sample", run, ID, policies="best")
        refused("^`n_policies` must be", run, ID, n_policies=0)
        refused("^`policies` must be a kind that the run has, it has no rewarding", run, ID)
        refused("^`policies` must be rewarding or sample", run, ID, policies="elites")

    @pytest.mark.filterwarnings("ignore:run.json cannot say")
    def test_an_environment_that_is_needed(self, make_model, tmp_path, refused):
        def make_env():
            env = gym.make("CartPole-v1", max_episode_steps=20)
            return gym.wrappers.TransformReward(env, lambda reward: 2.0 * reward)

        train(make_model, make_env(), tmp_path / "doubled", 1)
        refused("^`env` must be given, in Python", tmp_path / "doubled", ID, policies="sample")
        dataset = export_minari(tmp_path / "doubled", ID, policies="sample", env=make_env())
        assert all((episode.rewards == 2.0).all() for episode in dataset)

    def test_no_sample(self, run, refused):
        (RunFolder(run).checkpoint / "sample.npz").unlink()
        refused(
            "^`folder` must be that of a run, .*sample.npz is damaged", run, ID, policies="sample"
        )

    def test_a_damaged_sample(self, run, refused):
        path = RunFolder(run).checkpoint / "sample.npz"
        whole = kept(run, "sample.npz")
        nan = np.full_like(whole["parameters"], np.nan)
        for damage in [
            {"parameters": whole["parameters"][:, 1:]},
            {"parameters": whole["parameters"][1:]},
            {"parameters": nan},
            {"episode_seed": -1 - whole["episode_seed"]},
        ]:
            np.savez(path, **(whole | damage))
            refused("is damaged", run, ID, policies="sample")

    def test_other_algorithms(self, make_model, tmp_path, refused):
        train(make_model, ENVS["pendulum"](), tmp_path / "td3", 40, TD3ICM)
        refused("^`run` must be of an algorithm that evolves policies", tmp_path / "td3", ID)
        small = {"n_steps": 20, "batch_size": 20, "n_epochs": 1, "device": "cpu"}
        PPO("MlpPolicy", "CartPole-v1", **small).learn(40, SaveRun(tmp_path / "ppo"))
        refused("^`run` must be of an algorithm that evolves policies", tmp_path / "ppo", ID)

    def test_no_run(self, tmp_path):
        with pytest.raises(FileNotFoundError, match="`folder` must be that of a run"):
            export_minari(tmp_path, ID)
