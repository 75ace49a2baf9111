"""Each of Stable-Baselines3's algorithms as a run: trained, described, gone on with, and played."""

import itertools
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.save_util import load_from_zip_file

from curiosity_algos.bonuses.base import keyword_only
from curiosity_algos.bonuses.make import BONUSES, bonus_keywords
from curiosity_algos.common.names import CONTRIB, STABLE_BASELINES
from curiosity_algos.curiosity.curiosity import Curiosity
from curiosity_algos.experiments import RunFolder, SaveRun, load_final_states, load_runs
from curiosity_algos.experiments.baselines import _default_policy, load_baseline
from curiosity_algos.experiments.film import play
from curiosity_algos.experiments.run_spec import RunSpec
from curiosity_algos.experiments.training import train
from curiosity_algos.sb3.bonus_wrapper import BonusVecEnvWrapper
from curiosity_algos.sb3.replay_buffer import BonusReplayBuffer

US = "CuriosityMaze-US-v0"
HOLDS = hasattr(gym.wrappers, "RepeatAction")
TRAINED_OFTEN = {"train_interval": 40, "n_updates": 1, "batch_size": 16, "hidden": 8}
LEARNS = {"A2C": {}, "PPO": {"batch_size": 30, "n_epochs": 1}, "TRPO": {"batch_size": 30}}
"""The algorithms that are on-policy, and how they learn."""
NAMES = (*STABLE_BASELINES, *CONTRIB)


def small(name, *, bonus=None, timesteps=180, n_envs=2, learning_starts=50, window=None, **others):
    """A run of a few seconds at most; its statistics are of the last `window` episodes."""
    settings = {"policy_kwargs": {"net_arch": [8]}, "device": "cpu"}
    settings |= {} if window is None else {"stats_window_size": window}
    if name in LEARNS:
        settings |= {"n_steps": 30} | LEARNS[name]
    else:
        settings |= {"learning_starts": learning_starts, "train_freq": 20}
        settings |= {"buffer_size": 500, "batch_size": 16}
    env = others.pop("env", US if name not in ("DQN", "QRDQN") else "CartPole-v1")
    env_kwargs = {"horizon": 50} if env == US else {}
    given = {"settings": settings, "bonus": bonus, "n_envs": n_envs, **others}
    return RunSpec(name, env, 0, timesteps, env_kwargs, **given)


@pytest.mark.parametrize(
    ("name", "bonus"), [*zip(NAMES, itertools.cycle(["rnd", None])), ("TD3ICM", None)]
)
def test_each_is_trained_described_and_played(name, bonus, tmp_path):
    run = small(name, bonus=bonus, bonus_kwargs=TRAINED_OFTEN if bonus else {})
    run.check()
    assert train(run, tmp_path)
    assert not train(run, tmp_path)
    (row,) = load_runs(tmp_path).to_dict("records")
    assert row["algorithm"] == (name if bonus is None else f"{name} + RND")
    assert row["timesteps"] >= 180
    assert len(load_final_states(tmp_path)["return"]) == row["n_episodes"] > 1
    assert np.isfinite(play(tmp_path, seed=0).mean_return)


def test_keywords_are_the_owners_or_the_bonus_own():
    kwargs = {"weight": 0.5, "extrinsic": False, "power": 2.0, "n_updates": 3}
    wrapper = small("PPO", bonus="apt", bonus_kwargs=kwargs).make().get_env()
    buffer = small("SAC", bonus="apt", bonus_kwargs=kwargs).make().replay_buffer
    assert isinstance(wrapper, BonusVecEnvWrapper)
    for owner in (wrapper, buffer):
        assert (owner.weight, owner.extrinsic, owner.n_updates) == (0.5, False, 3)
        assert owner.bonus.power == 2.0
    owners = BonusVecEnvWrapper, BonusReplayBuffer, Curiosity
    of_owners = {name for owner in owners for name in keyword_only(owner)}
    assert not of_owners & set().union(*map(bonus_keywords, BONUSES))


@pytest.mark.parametrize(
    ("space", "policy"),
    [
        (spaces.Box(-1, 1, (3,)), "MlpPolicy"),
        (spaces.Box(0, 255, (4, 40, 36), np.uint8), "CnnPolicy"),
        (spaces.Box(0, 255, (7, 7, 3), np.uint8), "MlpPolicy"),
        (spaces.Dict({"a": spaces.Box(-1, 1, (3,))}), "MultiInputPolicy"),
    ],
)
def test_the_policy_suits_the_observations(space, policy):
    assert _default_policy(space) == policy


def cut(monkeypatch, run, folder, timesteps):
    """Train until Ctrl-C comes in the midst of a rollout; a checkpoint is taken before each."""

    def press(self):
        if self.model.num_timesteps >= timesteps:
            raise KeyboardInterrupt
        return on_step(self)

    on_step = SaveRun._on_step
    with monkeypatch.context() as patched:
        patched.setattr(SaveRun, "_on_step", press)
        with pytest.raises(KeyboardInterrupt):
            train(run, folder, interval=1e-9)
    stood = int(RunFolder(folder).checkpoint.name)
    assert 0 < stood < timesteps
    return stood


def parameters(folder):
    path = RunFolder(folder).checkpoint / "model"
    return load_from_zip_file(path, load_data=False, device="cpu")[1]["policy"]


EXACT = {
    "PPO": small("PPO"),
    "A2C with a bonus": small("A2C", bonus="apt", bonus_kwargs=TRAINED_OFTEN),
    "PPO that remembers episodes": small("PPO", bonus="e3b", bonus_kwargs=TRAINED_OFTEN),
    "SAC": small("SAC"),
    "TD3 with a bonus": small("TD3", bonus="rnd", bonus_kwargs=TRAINED_OFTEN),
    "TD3ICM": small("TD3ICM", n_envs=1),
    "DDPG that acts at random": small("DDPG", learning_starts=150),
    "DQN": small("DQN"),
    "PPO in CartPole": small("PPO", env="CartPole-v1", bonus="apt", bonus_kwargs=TRAINED_OFTEN),
    "PPO in MiniGrid": small(
        "PPO",
        env="MiniGrid-MultiRoom-N2-S4-v0",
        wrappers=[("minigrid.wrappers:ImgObsWrapper", {})],
        bonus="apt",
        bonus_kwargs=TRAINED_OFTEN,
    ),
    "PPO in Ant": small("PPO", env="Ant-v5", bonus="apt", bonus_kwargs=TRAINED_OFTEN),
    "SAC in Ant": small("SAC", env="Ant-v5", bonus="icm", bonus_kwargs=TRAINED_OFTEN),
    "PPO that settles": small("PPO", env="CartPole-v1", window=1, settle=100.0),
    "PPO that holds": small("PPO", bonus="rnd", repeat_action=3, bonus_kwargs=TRAINED_OFTEN),
}


@pytest.mark.parametrize("kind", EXACT)
def test_a_run_that_was_cut_goes_on_as_if_it_had_not(kind, tmp_path, monkeypatch, assert_same):
    run = EXACT[kind]
    if run.repeat_action > 1 and not HOLDS:
        pytest.skip("gymnasium < 1.3")
    if "MiniGrid" in kind:
        pytest.importorskip("minigrid")
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    train(run, whole)
    cut(monkeypatch, run, killed, 130)
    assert train(run, killed)
    ended = [RunFolder(folder).result()["timesteps"] for folder in (whole, killed)]
    takes_20_steps = "learning_starts" in run.settings and run.n_envs > 1
    assert ended == [200 if takes_20_steps else 180] * 2  # whole rollouts
    assert_same(load_final_states(killed), load_final_states(whole))
    one, other = parameters(killed), parameters(whole)
    assert all(th.equal(one[name], other[name]) for name in other)


def test_settling_is_part_of_a_run(tmp_path):
    settles = small("PPO", settle=100.0)
    train(settles, tmp_path)
    assert RunFolder(tmp_path).describe()["settings"]["settle"] == 100.0
    for other in (None, 200.0):
        with pytest.raises(ValueError, match="settle"):
            train(replace(settles, settle=other, timesteps=240), tmp_path)
    assert train(replace(settles, timesteps=240), tmp_path)


@pytest.mark.parametrize("name", ["SAC", "TD3ICM"])
def test_more_timesteps_go_on_with_the_bonus_and_what_a_callback_changed(
    name, tmp_path, monkeypatch, assert_same
):
    """Though the last checkpoint keeps no transitions."""
    kwargs = {"bonus": "rnd", "bonus_kwargs": TRAINED_OFTEN} if name == "SAC" else {}
    run, longer = (small(name, n_envs=1, timesteps=n, **kwargs) for n in (180, 240))
    trained = []

    def change(self):
        buffer = self.model.replay_buffer
        if self.num_timesteps == 100:
            buffer.weight, buffer.n_updates = 0.125, 3
        trained[:] = [buffer.bonus.state_dict()]
        return on_step(self)

    on_step = SaveRun._on_step
    with monkeypatch.context() as patched:
        patched.setattr(SaveRun, "_on_step", change)
        train(run, tmp_path)
    with pytest.warns(UserWarning, match="without the replay buffer"):
        model = run.load(RunFolder(tmp_path).checkpoint)
    buffer = model.replay_buffer
    assert (buffer.weight, buffer.n_updates, buffer.size()) == (0.125, 3, 0)
    if name == "SAC":  # TD3ICM has trained once more, after its last step
        assert_same(buffer.bonus.state_dict(), trained[0])
    with pytest.warns(UserWarning, match="without the replay buffer"):
        assert train(longer, tmp_path)
    described = load_runs(tmp_path).iloc[0]
    assert described["timesteps"] == 240


def test_a_memory_goes_on_in_mid_episode(tmp_path, assert_same):
    """That of a recurrent policy, which its own file leaves out."""

    def make_envs():
        return make_vec_env(US, 2, seed=0, env_kwargs={"horizon": 50})

    def begin(folder, timesteps):
        small = {"n_steps": 30, "batch_size": 30, "n_epochs": 1, "seed": 0, "device": "cpu"}
        kwargs = {"lstm_hidden_size": 8, "net_arch": [8]}
        model = RecurrentPPO("MlpLstmPolicy", make_envs(), policy_kwargs=kwargs, **small)
        return model.learn(timesteps, SaveRun(folder))

    whole, grown = tmp_path / "whole", tmp_path / "grown"
    begin(whole, 180)
    begin(grown, 120)  # 60 steps of each environment, in mid-episode
    model = load_baseline(RecurrentPPO, RunFolder(grown).checkpoint, make_envs(), device="cpu")
    assert any(part.any() for pair in model._last_lstm_states for part in pair)
    model.learn(60, SaveRun(grown), reset_num_timesteps=False)
    assert_same(load_final_states(grown), load_final_states(whole))
    one, other = parameters(grown), parameters(whole)
    assert all(th.equal(one[name], other[name]) for name in other)


class TestPlayed:
    @pytest.mark.parametrize("name", ["A2C", "QRDQN", "SAC"])
    def test_no_code_of_the_file_is_run(self, name, tmp_path, monkeypatch):
        """SB3 unpickles what is in the `data` of a model's file, and with it whatever it likes."""
        train(small(name, timesteps=60), tmp_path)
        monkeypatch.setattr("stable_baselines3.common.save_util.json_to_data", None)
        played = play(tmp_path, seed=0).mean_return
        with pytest.raises(TypeError):
            play(tmp_path, seed=0, trust=True)
        monkeypatch.undo()
        assert play(tmp_path, seed=0, trust=True).mean_return == played

    def test_a_policy_with_classes_needs_trust(self, tmp_path):
        run = small("PPO", timesteps=60)
        kwargs = {"policy_kwargs": {"activation_fn": th.nn.ReLU}}
        train(replace(run, settings={**run.settings, **kwargs}), tmp_path)
        with pytest.raises(ValueError, match="`trust` must be given"):
            play(tmp_path, seed=0)
        assert play(tmp_path, seed=0, trust=True).mean_return == 0.0
