"""Every algorithm in environments of every kind of space."""

import functools
import re
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch as th
from gymnasium import spaces
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import DummyVecEnv
from stable_baselines3.td3 import MultiInputPolicy
from toys import OFF_POLICY, SPACES, Toy, Words

from curiosity_algos import (
    NSES,
    NSLC,
    TD3ICM,
    BonusReplayBuffer,
    BonusVecEnvWrapper,
    CuriosityES,
    GymnasiumVecEnv,
    make_evaluator,
)
from curiosity_algos.bonuses.make import BONUSES
from curiosity_algos.evaluation.flat_spaces import numeric
from curiosity_gym import BehaviorWrapper

GENERATION = 30
PAGE = Path(__file__).parents[2] / "docs" / "algorithms" / "index.md"
BOX = spaces.Box(-1, 1, (2,))
OBSERVATIONS = {
    "Box, a vector": BOX,
    "Box of another shape": spaces.Box(-1, 1, (2, 2)),
    "image of 36 by 36": spaces.Box(0, 255, (36, 36, 1), np.uint8),
    "image of 84 by 84": spaces.Box(0, 255, (84, 84, 3), np.uint8),
    "Discrete from 0": spaces.Discrete(3),
    "Discrete from elsewhere": spaces.Discrete(3, start=2),
    "MultiBinary": spaces.MultiBinary(3),
    "MultiDiscrete": spaces.MultiDiscrete([2, 3]),
    "Dict": spaces.Dict(a=BOX, b=spaces.Discrete(2)),
    "Tuple": spaces.Tuple([BOX, spaces.Discrete(2)]),
    "Dict with a text beside others": spaces.Dict(a=BOX, mission=spaces.Text(5)),
    "Dict or Tuple in another": spaces.Dict(a=spaces.Dict(b=BOX), c=spaces.Tuple([BOX])),
}
ACTIONS = {
    "Box, a vector with bounds": BOX,
    "Box without bounds": spaces.Box(-np.inf, np.inf, (2,)),
    "Box of another shape": spaces.Box(-1, 1, (2, 2)),
    "Box of whole numbers": spaces.Box(-2, 2, (2,), np.int64),
    "Discrete from 0": spaces.Discrete(3),
    "Discrete from elsewhere": spaces.Discrete(3, start=1),
    "MultiDiscrete": spaces.MultiDiscrete([2, 3]),
    "MultiBinary": spaces.MultiBinary(3),
    "Dict, Tuple": spaces.Tuple([spaces.Discrete(2)]),
}
"""The rows of the documentation's tables."""


@pytest.fixture(params=SPACES)
def name(request):
    return request.param


def batch_of(space, observations):
    """Observations as a vector environment gives them."""
    empty = gym.vector.utils.create_empty_array(space, len(observations))
    return gym.vector.utils.concatenate(space, observations, empty)


class TestEveryAlgorithm:
    def test_a_run_resumes_in_every_bit(self, algorithm, name, make_model, assert_resumes):
        model = make_model(algorithm, functools.partial(Toy, name)).learn(GENERATION)
        resumed = assert_resumes(model, Toy(name), timesteps=GENERATION)
        assert resumed.observation_space == numeric(Toy(name).observation_space)
        assert model.generation > 1

    def test_actions_are_the_environments_own(self, algorithm, name, make_model):
        env = Toy(name)
        model = make_model(algorithm, env).learn(GENERATION)
        observations = [env.observation_space.sample() for _ in range(4)]
        singly = [model.predict(each, deterministic=True)[0] for each in observations]
        for action in singly:
            assert env.action_space.contains(action)
            assert isinstance(action, np.integer) == isinstance(env.action_space, spaces.Discrete)
        together, _ = model.predict(batch_of(env.observation_space, observations))
        np.testing.assert_array_equal(together, singly)
        assert together.dtype == env.action_space.dtype
        mean_return, _ = evaluate_policy(model, model.get_env(), n_eval_episodes=1)
        assert mean_return == model.best_return


class TestTD3ICM:
    @pytest.mark.parametrize("name", OFF_POLICY)
    def test_it_learns_and_predicts_for_the_environments_own_observations(self, name, make_model):
        env, model = Toy(name), make_model(TD3ICM, Toy(name), learning_starts=10).learn(25)
        assert model._n_updates > 0
        observations = [env.observation_space.sample() for _ in range(4)]
        singly = [model.predict(each, deterministic=True)[0] for each in observations]
        assert all(map(env.action_space.contains, singly))
        together, _ = model.predict(batch_of(env.observation_space, observations), None, None, True)
        np.testing.assert_allclose(together, singly, rtol=1e-5, atol=1e-6)

    def test_a_dictionary_has_its_policy(self, make_model):
        assert isinstance(make_model(TD3ICM, Toy("task")).policy, MultiInputPolicy)
        with pytest.raises(ValueError, match="You must use `MultiInputPolicy`"):
            make_model(TD3ICM, Toy("task"), policy="MlpPolicy")


def play(env, policy):
    """One episode by the environment's own observations and actions."""
    observation, _ = env.reset()
    seen, taken, total, is_over = [observation], [], 0.0, False
    while not is_over:
        taken.append(policy.predict(observation)[0])
        observation, reward, terminated, truncated, info = env.step(taken[-1])
        seen.append(observation)
        total += reward
        is_over = terminated or truncated
    return seen, taken, total, info


VECTORS = {
    "one": lambda make: make(),
    "function": lambda make: make,
    "next step": lambda make: SyncVectorEnv([make] * 3),
    "same step": lambda make: SyncVectorEnv([make] * 3, autoreset_mode=AutoresetMode.SAME_STEP),
    "disabled": lambda make: SyncVectorEnv([make] * 3, autoreset_mode=AutoresetMode.DISABLED),
    "dummy": lambda make: DummyVecEnv([make] * 3),
}


class TestEvaluators:
    """What plays a population gives what a plain loop gives, for a bonus to see."""

    def check(self, name, env):
        policy = CuriosityES(Toy(name), policy_kwargs={"net_arch": [4]}).policy
        seen, acted = policy.seen, policy.acted
        evaluator = make_evaluator(env, {"net_arch": [4]})
        rng = np.random.default_rng(0)
        parameters = rng.normal(0, 1, (4, evaluator.n_parameters)).astype(np.float32)
        rollouts = evaluator.evaluate(parameters, seed=1)
        for i, vector in enumerate(parameters):
            policy.vector[:] = vector
            observations, actions, total, info = play(Toy(name), policy)
            n = len(actions)
            assert (rollouts.lengths[i], rollouts.returns[i]) == (n, total)
            flat = np.array([seen.one(each) for each in observations], dtype=np.float32)
            np.testing.assert_array_equal(rollouts.observations[i, : n + 1], flat)
            np.testing.assert_array_equal(rollouts.final_observations[i], flat[-1])
            np.testing.assert_array_equal(rollouts.actions[i, :n], acted.seen(np.array(actions)))
            if name == "goal":
                achieved = observations[-1]["achieved_goal"].astype(np.float32)
                np.testing.assert_array_equal(rollouts.behaviors[i], achieved)
            else:
                np.testing.assert_array_equal(rollouts.behaviors[i], info["behavior"])
        assert len(np.unique(rollouts.returns)) > 1

    @pytest.mark.parametrize("vector", VECTORS)
    def test_a_plain_loop(self, name, vector):
        if vector == "dummy" and name in ("nested", "mission", "texts"):
            pytest.skip("SB3's own vector environments have no room for these")
        self.check(name, VECTORS[vector](functools.partial(Toy, name)))


def test_what_a_goal_task_has_achieved_is_its_behavior(make_model):
    model = make_model(NSES, Toy("goal"), behavior="final").learn(GENERATION)
    assert model._behavior_space == SPACES["goal"][0]["achieved_goal"]
    assert model.coverage is None  # the environment says no cells that count
    own = spaces.Box(-1, 1, (1,))  # comes first
    evaluator = make_evaluator(BehaviorWrapper(Toy("goal"), lambda *_: [0.5], own))
    rollouts = evaluator.evaluate(np.zeros((1, evaluator.n_parameters)))
    np.testing.assert_array_equal(rollouts.behaviors, [[0.5]])


@pytest.mark.extra("robotics")
@pytest.mark.parametrize("algorithm", [NSES, TD3ICM])
def test_point_maze(algorithm, make_model, tmp_path):
    import gymnasium_robotics

    gym.register_envs(gymnasium_robotics)
    make_env = functools.partial(gym.make, "PointMaze_UMaze-v3", max_episode_steps=20)
    settings = {"behavior": "final"} if algorithm is NSES else {"learning_starts": 20}
    model = make_model(algorithm, make_env, **settings).learn(40)
    model.save(tmp_path / "model")
    resumed = algorithm.load(tmp_path / "model", env=make_env)
    before, after = (each.policy.state_dict() for each in (model, resumed))
    assert all(th.equal(before[name], after[name]) for name in before)


class TestWords:
    """What is no number in a Dict is left out, and said once."""

    @pytest.mark.parametrize("algorithm", [CuriosityES, NSLC])
    @pytest.mark.parametrize("give", [lambda make: make(), lambda make: make], ids=["env", "maker"])
    def test_one_warning_says_so(self, algorithm, give, make_model):
        names = {"mission": spaces.Text(9), "place": BOX, "says": Words()}

        def make_env():
            env = Toy("minigrid")
            env.observation_space = spaces.Dict(names)
            return env

        with pytest.warns(
            UserWarning, match=r"'mission', Text\(.*; 'says', Words\(\).*Wrap"
        ) as all_:
            model = make_model(algorithm, give(make_env))
        assert len(all_) == 1
        assert model.observation_space == spaces.Dict(place=BOX)

    def test_bonuses_leave_them_out_too(self):
        envs = SyncVectorEnv([lambda: Toy("mission")] * 2, autoreset_mode=AutoresetMode.SAME_STEP)
        with pytest.warns(UserWarning, match=r"'mission', Words\(\)") as warned:
            venv = BonusVecEnvWrapper(GymnasiumVecEnv(envs), bonus="rnd", train_interval=8)
        assert len(warned) == 1
        venv.reset()
        for _ in range(8):
            _, rewards, _, _ = venv.step(np.array([0, 1]))
        assert venv.bonus.shape == (4 + 147,)
        assert np.isfinite(rewards).all()

    @pytest.mark.filterwarnings("ignore:Nothing is learned")
    @pytest.mark.parametrize("give", [lambda make: make(), lambda make: make], ids=["env", "maker"])
    def test_sb3s_policies_refuse_them(self, give, make_model):
        make_env = functools.partial(Toy, "mission", BOX)
        with pytest.raises(ValueError, match=r"Words\(\).* FilterObservation leaves entries"):
            make_model(TD3ICM, give(make_env))


def table(kind):
    """The documentation's table of observations or actions: row, what each column says."""
    rows = re.search(rf"^\| {kind} \|.*\n\|[-|]+\n((?:\|.*\n)+)", PAGE.read_text(), flags=re.M)
    cells = [[cell.strip() for cell in row.split("|")[1:-1]] for row in rows[1].splitlines()]
    return {label: says for label, *says in cells}


def makers(observation_space, action_space, make_model, algorithms):
    """By column of the table, functions that make all that it stands for."""

    class Bare(gym.Env):
        behavior_space = spaces.Box(-1, 1, (2,))

    def make_env():
        env = Bare()
        env.observation_space, env.action_space = observation_space, action_space
        return env

    settings = {"buffer_size": 10, "device": "cpu", "bonus_kwargs": {"hidden": 4}}
    off_policy = BONUSES.keys() - {"e3b", "etd", "ngu", "noveld"}
    both = {"observation_space": observation_space, "action_space": action_space}
    return [
        [functools.partial(make_model, each, make_env()) for each in algorithms],
        [functools.partial(make_model, TD3ICM, make_env())],
        [
            lambda bonus=bonus: BonusVecEnvWrapper(
                GymnasiumVecEnv(SyncVectorEnv([make_env], autoreset_mode=AutoresetMode.SAME_STEP)),
                bonus=bonus,
                **settings,
            )
            for bonus in BONUSES
        ],
        [functools.partial(BonusReplayBuffer, **both, bonus=b, **settings) for b in off_policy],
    ]


def takes(make):
    try:
        make()
    except ValueError as error:
        return "no" if re.search(r"space|`v?env` must", str(error)) else repr(error)
    return "yes"


@pytest.mark.parametrize(
    ("kind", "label"),
    [("observations", each) for each in OBSERVATIONS] + [("actions", each) for each in ACTIONS],
)
def test_the_documentation_says_who_takes_what(kind, label, make_model, algorithms):
    is_observed = kind == "observations"
    pair = (OBSERVATIONS[label], BOX) if is_observed else (BOX, ACTIONS[label])
    found = [{takes(make) for make in column} for column in makers(*pair, make_model, algorithms)]
    assert found == [{says} for says in table(kind)[label]]


def test_the_documentation_has_these_rows():
    assert list(table("observations")) == list(OBSERVATIONS)
    assert list(table("actions")) == list(ACTIONS)
