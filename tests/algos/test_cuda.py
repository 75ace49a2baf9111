"""What a GPU computes is what the processor does, but for rounding, and a run goes on on either."""

import io

import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.env_util import make_vec_env

from curiosity_algos import (
    AURORA,
    NSLC,
    TD3ICM,
    BonusReplayBuffer,
    BonusVecEnvWrapper,
    CuriosityES,
    CuriosityMAPElites,
)
from curiosity_algos.bonuses.base import Bonus
from curiosity_algos.bonuses.make import BONUSES, make_bonus
from curiosity_algos.experiments import RunFolder, load_runs
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import train

pytestmark = pytest.mark.skipif(
    not th.cuda.is_available(), reason="there is no GPU, or `make gpu` was not asked for"
)

ACTIONS = spaces.Box(-1, 1, (2,))
SEED = np.random.SeedSequence(0)
OBSERVATIONS = {
    "vectors": spaces.Box(-1, 1, (6,)),
    "tiles": spaces.Box(0, 255, (7, 7, 3), np.uint8),
    "pixels": spaces.Box(0, 255, (3, 40, 40), np.uint8),
}
CURIOUS = [CuriosityES, CuriosityMAPElites, AURORA]
"""The algorithms that train networks of their own."""
MAZE = spaces.Box(-1, 1, (36,))
SAMPLED = [name for name, bonus in BONUSES.items() if bonus.episodes is Bonus.episodes]
"""Bonuses that ask for no episodes."""


def transitions(space, n, seed=0):
    """Observations of one walk, actions, and the observations that these led to."""
    space.seed(seed)
    observations = np.stack([space.sample() for _ in range(n + 1)])
    actions = np.random.default_rng(seed).uniform(-1, 1, (n, 2)).astype(np.float32)
    return observations[:-1], actions, observations[1:]


def make(name, space, device):
    return make_bonus(name, {"n_features": 8}, space, ACTIONS, seed=SEED, device=device)


def learn(bonus, space, n_updates=3):
    """Train a bonus, and return its losses."""
    losses = []
    for seed in range(n_updates):
        batch = [th.from_numpy(each) for each in transitions(space, 32, seed)]
        bonus.observe(batch[0])
        losses.append(bonus.update(*batch))
    return losses


def scores(bonus, space):
    """What a walk is worth, as the first of an episode where that counts."""
    return (bonus.episodes(16) or bonus).score(*transitions(space, 16, seed=9))


def assert_same_scores(one, other, space=MAZE, **tolerances):
    np.testing.assert_allclose(scores(one, space), scores(other, space), **tolerances)


@pytest.fixture(params=BONUSES)
def name(request):
    return request.param


@pytest.fixture(autouse=True)
def _whole_floats(monkeypatch):
    """Convolutions keep all bits of a float, as they do on the processor."""
    monkeypatch.setattr(th.backends.cudnn, "allow_tf32", False)


@pytest.mark.parametrize("space", OBSERVATIONS.values(), ids=OBSERVATIONS)
class TestBonuses:
    def test_it_scores_and_learns_as_on_the_processor(self, name, space):
        here, there = make(name, space, "cpu"), make(name, space, "cuda")
        assert {each.device.type for each in there.parameters()} == {"cuda"}
        assert_same_scores(there, here, space, rtol=1e-3, atol=1e-4)
        for one, other in zip(learn(there, space), learn(here, space), strict=True):
            assert one == pytest.approx(other, rel=2e-2, abs=1e-3)
        assert_same_scores(there, here, space, rtol=5e-2, atol=1e-3)

    @pytest.mark.parametrize(("begun", "gone_on"), [("cuda", "cpu"), ("cpu", "cuda")])
    def test_it_goes_on_elsewhere(self, name, space, begun, gone_on):
        one, other = make(name, space, begun), make(name, space, gone_on)
        learn(one, space)
        file = io.BytesIO()
        th.save(one.state_dict(), file)
        file.seek(0)
        other.load_state_dict(th.load(file, map_location="cpu", weights_only=False))
        assert_same_scores(one, other, space, rtol=1e-3, atol=1e-4)
        for loss, same in zip(learn(one, space), learn(other, space), strict=True):
            assert loss == pytest.approx(same, rel=5e-2, abs=2e-3)


class TestAlgorithms:
    @pytest.mark.parametrize("algorithm", CURIOUS)
    def test_a_run_goes_on_bit_for_bit(self, algorithm, make_model, make_easy_maze, assert_resumes):
        model = make_model(algorithm, make_easy_maze(), device="cuda").learn(600)
        resumed = assert_resumes(model, make_easy_maze(), device="cuda")
        assert model.device.type == resumed.device.type == "cuda"

    @pytest.mark.parametrize(("begun", "gone_on"), [("cuda", "cpu"), ("cpu", "cuda")])
    @pytest.mark.parametrize("algorithm", CURIOUS)
    def test_a_run_goes_on_elsewhere(
        self, algorithm, make_model, make_easy_maze, tmp_path, begun, gone_on
    ):
        make_model(algorithm, make_easy_maze(), device=begun).learn(600).save(tmp_path / "model")
        model = algorithm.load(tmp_path / "model", env=make_easy_maze(), device=gone_on)
        before = model.num_timesteps
        assert model.learn(600, reset_num_timesteps=False).num_timesteps >= before + 600
        assert model.device.type == gone_on

    def test_learned_behaviors(self, make_model, make_easy_maze, assert_resumes):
        model = make_model(NSLC, make_easy_maze(), behavior="learned", device="cuda").learn(600)
        assert_resumes(model, make_easy_maze(), device="cuda")


class TestStableBaselines:
    def test_ppo_with_every_bonus(self, name, tmp_path):
        below = make_vec_env("CuriosityMaze-US-v0", 4, seed=0)
        venv = BonusVecEnvWrapper(below, bonus=name, seed=0, device="cuda")
        PPO("MlpPolicy", venv, n_steps=64, seed=0, device="cuda").learn(600)
        venv.save(tmp_path / "bonus.npz")
        below = make_vec_env("CuriosityMaze-US-v0", 4, seed=0)
        loaded = BonusVecEnvWrapper.load(tmp_path / "bonus.npz", below, device="cpu")
        assert_same_scores(loaded.bonus, venv.bonus, rtol=1e-2, atol=1e-3)

    def test_td3icm(self, make_model, make_easy_maze):
        model = make_model(TD3ICM, make_easy_maze(), device="cuda").learn(200)
        assert model._n_updates > 0
        assert {each.device.type for each in model.replay_buffer.bonus.parameters()} == {"cuda"}

    @pytest.mark.parametrize("bonus", SAMPLED)
    def test_sac_with_every_bonus(self, bonus, tmp_path):
        def make_sac(device):
            return SAC(
                "MlpPolicy",
                make_vec_env("CuriosityMaze-US-v0", 2, seed=0),
                learning_starts=50,
                train_freq=8,
                gradient_steps=2,
                replay_buffer_class=BonusReplayBuffer,
                replay_buffer_kwargs={"bonus": bonus, "train_interval": 64},
                seed=0,
                device=device,
            )

        model = make_sac("cuda").learn(400)
        batch = model.replay_buffer.sample(8)
        assert batch.rewards.device.type == "cuda"
        assert bool((batch.rewards != 0).any())
        model.replay_buffer.save(tmp_path / "buffer.npz")
        other = make_sac("cpu")
        other.replay_buffer.restore(tmp_path / "buffer.npz")
        bonuses = other.replay_buffer.bonus, model.replay_buffer.bonus
        assert_same_scores(*bonuses, rtol=1e-2, atol=1e-3)


def test_the_folder_of_a_run_is_read_without_a_gpu(tmp_path):
    small = {"device": "cuda", "population_size": 10, "n_parents": 5}
    run = RunSpec("CuriosityES", "CuriosityMaze-US-v0", 0, 2e5, settings=small)
    folder = run.folder(tmp_path)
    train(run, folder)
    assert load_runs(tmp_path)["timesteps"].item() >= 2e5
    saved = CuriosityES.load(RunFolder(folder).checkpoint / "model", device="cpu")
    assert saved.device.type == "cpu"
