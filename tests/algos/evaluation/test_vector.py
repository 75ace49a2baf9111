import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs.classic_control import PendulumEnv
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, SubprocVecEnv, VecEnvWrapper

from curiosity_algos import CanonicalES, make_evaluator
from curiosity_algos.evaluation import vector
from curiosity_algos.evaluation.mlp import build_mlp
from curiosity_algos.evaluation.vector import VectorEvaluator

IDS = {"Pendulum-v1": 30, "maze": 64}
N_INDIVIDUALS = 5


def gymnasium_kind(kind, n, mode):
    return lambda make: kind([make] * n, autoreset_mode=mode)


KINDS = {
    "single": lambda make: make(),
    "monitored": lambda make: Monitor(make()),
    **{f"sync-{mode.name}": gymnasium_kind(SyncVectorEnv, 3, mode) for mode in AutoresetMode},
    "async": gymnasium_kind(AsyncVectorEnv, 2, AutoresetMode.NEXT_STEP),
    "dummy": lambda make: DummyVecEnv([lambda: Monitor(make())] * 3),
    "subproc": lambda make: SubprocVecEnv([make] * 2, start_method="fork"),
}


@pytest.fixture(scope="module", params=IDS)
def env_maker(request):
    if request.param != "maze":
        return lambda: gym.make(request.param, max_episode_steps=IDS[request.param])
    # The generic evaluator takes mazes too: they have behaviors, successes and early ends.
    layout = "#####\n#S.G#\n#####"
    return lambda: gym.make("CuriosityMaze-v0", layout=layout, horizon=64, goal_radius=12)


def make_policies(env, seed=0):
    mlp = build_mlp(env.observation_space, env.action_space, [6])
    rng = np.random.default_rng(seed)
    return mlp, rng.normal(0, 1, (N_INDIVIDUALS, mlp.n_parameters)).astype(np.float32)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_env_equals_a_plain_loop(kind, env_maker, play, assert_equal_episodes):
    oracle = env_maker()
    mlp, parameters = make_policies(oracle)
    env = KINDS[kind](env_maker)
    try:
        evaluator = VectorEvaluator(env, mlp)
        for seed in (3, 4):
            rollouts = evaluator.evaluate(parameters, seed)
            episodes = play(oracle, mlp, parameters, seed)
            assert_equal_episodes(rollouts, episodes)
    finally:
        env.close()


def test_a_vector_env_with_one_generator_for_all_is_seeded_once():
    env = gym.make_vec("CartPole-v1", num_envs=3)
    assert not hasattr(env.unwrapped, "env_fns")
    mlp = build_mlp(env.single_observation_space, env.single_action_space, [6])
    parameters = np.random.default_rng(0).normal(0, 1, (4, mlp.n_parameters)).astype(np.float32)
    one, same = (VectorEvaluator(env, mlp).evaluate(parameters, 7) for _ in range(2))
    np.testing.assert_array_equal(one.final_observations, same.final_observations)
    np.testing.assert_array_equal(one.returns, one.lengths)


class NoInfos(VecEnvWrapper):
    """Says nothing of how an episode ended."""

    def reset(self):
        return self.venv.reset()

    def step_wait(self):
        return *self.venv.step_wait()[:3], [{}] * self.num_envs


def test_last_observations_may_not_be_missing():
    mlp, parameters = make_policies(gym.make("CartPole-v1"))
    evaluator = VectorEvaluator(NoInfos(DummyVecEnv([lambda: gym.make("CartPole-v1")] * 2)), mlp)
    with pytest.raises(ValueError, match=r"^`env` must give the last .* `terminal_observation`"):
        evaluator.evaluate(parameters, 3)


class Counting(PendulumEnv):
    """It says, and holds, its limit itself."""

    horizon = np.int64(60)

    def reset(self, **given):
        self.t = 0
        return super().reset(**given)

    def step(self, action):
        self.t += 1
        observation, reward, *_, info = super().step(action)
        return observation, reward, False, self.t == 60, info


class WithSpec(Counting):
    """It says so in its spec."""

    horizon = None
    spec = gym.envs.registration.EnvSpec("Counting-v0", max_episode_steps=60)


def limited():
    return gym.wrappers.TimeLimit(PendulumEnv(), 60)


ENDLESS = {
    "single": PendulumEnv,
    "subproc": lambda: SubprocVecEnv([PendulumEnv] * 2, start_method="fork"),
}
LIMITS = {
    "single": limited,
    "horizon": Counting,
    "spec": WithSpec,
    "wrapped sync": lambda: gym.wrappers.vector.RecordEpisodeStatistics(
        SyncVectorEnv([limited] * 2)
    ),
    "async horizon": lambda: AsyncVectorEnv([Counting] * 2),
    "subproc": lambda: SubprocVecEnv([limited] * 2, start_method="fork"),
}


class TestLength:
    @pytest.fixture(autouse=True)
    def _bound(self, monkeypatch):
        monkeypatch.setattr(vector, "MAX_EPISODE_STEPS", 50)

    @pytest.mark.parametrize("kind", ENDLESS)
    def test_episodes_that_do_not_end_are_an_error(self, kind):
        mlp, parameters = make_policies(PendulumEnv())
        env = ENDLESS[kind]()
        try:
            evaluator = VectorEvaluator(env, mlp)
            with pytest.raises(ValueError, match=r"had not ended after 50 steps\. Give it a limit"):
                evaluator.evaluate(parameters, 0)
        finally:
            env.close()

    @pytest.mark.parametrize("kind", LIMITS)
    def test_a_limit_of_the_env_may_be_higher(self, kind):
        mlp, parameters = make_policies(PendulumEnv())
        env = LIMITS[kind]()
        try:
            rollouts = VectorEvaluator(env, mlp).evaluate(parameters, 0)
        finally:
            env.close()
        np.testing.assert_array_equal(rollouts.lengths, 60)


class Odd(gym.Env):
    """Two steps; a test says what its infos and observations are."""

    observation_space = spaces.Box(-10.0, 10.0, (2,))
    action_space = spaces.Box(-1.0, 1.0, (1,))

    def __init__(self, behaviors=(), first=(0, 0), number=None):
        self.behaviors = behaviors
        self.first = first
        self.number = number

    def reset(self, *, seed=None, options=None):
        self.t = 0
        return np.array(self.first), {}

    def step(self, action):
        self.t += 1
        behavior = {} if self.number is None else self.behaviors[self.number]
        return np.array([0.5, -1.5]), 0.0, self.t == 2, False, behavior


@pytest.mark.parametrize(
    "behaviors",
    [
        [{"behavior": [1.0, 2.0]}, {}],
        [{"behavior": [1.0, 2.0]}, {"behavior": [1.0]}],
        [{"behavior": 1.0}, {"behavior": 2.0}],
    ],
)
def test_episodes_side_by_side_have_like_behaviors(behaviors):
    env = DummyVecEnv([lambda i=i: Odd(behaviors, number=i) for i in range(2)])
    with pytest.raises(ValueError, match=r"`env` must end every episode with an info"):
        make_evaluator(env, {"net_arch": []}).evaluate(np.zeros((2, 3)), 0)


class Wrong(Odd):
    """It gives one thing that it must not, in its second step unless it says in which."""

    def __init__(self, observation=(0.5, -1.5), reward=0.0, info=None, when=2):
        super().__init__(first=(0, 0) if when else observation)
        self.given = observation, reward, {} if info is None else info
        self.when = when

    def step(self, action):
        observation, reward, *ends, info = super().step(action)
        if self.t == self.when:
            observation, reward, info = self.given
        return observation, reward, *ends, info


SHAPE = "`env` must give, and take, values of its space"
FINITE = "`env` must give finite observations"
WRONG = [
    ({"observation": np.zeros(1)}, SHAPE),
    ({"observation": np.zeros((1, 2)), "when": 1}, SHAPE),
    ({"observation": np.zeros(1), "when": 0}, SHAPE),
    ({"observation": np.array([np.nan, 0.0]), "when": 0}, FINITE),
    ({"observation": np.array([0.0, -np.inf])}, FINITE),
    ({"info": [("behavior", 1.0)]}, "`env` must give a dictionary as info"),
]


@pytest.mark.parametrize(("given", "message"), WRONG)
def test_what_an_env_must_not_give_is_named(given, message):
    evaluator = make_evaluator(Wrong(**given), {"net_arch": []})
    with pytest.raises(ValueError, match=message):
        evaluator.evaluate(np.zeros((2, 3)), 0)


@pytest.mark.parametrize("reward", [2, np.array(2.0), True])
def test_rewards_of_any_type_are_numbers(reward):
    rollouts = make_evaluator(Wrong(reward=reward), {"net_arch": []}).evaluate(np.zeros((1, 3)), 0)
    assert rollouts.returns.tolist() == [float(reward)]


class Counted(Odd):
    """One whose reward is the number of its resets, and that counts how many were made."""

    n_made = 0
    n_resets = 0

    def __init__(self):
        super().__init__()
        Counted.n_made += 1

    def reset(self, **given):
        self.n_resets += 1
        return super().reset(**given)

    def step(self, action):
        observation, _, *rest = super().step(action)
        return observation, float(self.n_resets), *rest


class TestNumberOfEnvs:
    @pytest.fixture(autouse=True)
    def _count_anew(self, monkeypatch):
        monkeypatch.setattr(Counted, "n_made", 0)

    def test_of_an_object_is_one_which_plays_one_episode_after_the_other(self):
        evaluator = make_evaluator(Counted(), {"net_arch": []})
        for seed in (0, None):
            returns = evaluator.evaluate(np.zeros((20, 3)), seed).returns / 2
            assert (np.diff(returns) == 1).all()
        assert Counted.n_made == 1

    def test_of_a_function_is_that_of_the_policies_or_less(self):
        evaluator = make_evaluator(Counted, {"net_arch": []})
        for n, n_made in ((1, 1), (3, 3), (40, 16), (2, 16)):
            evaluator.evaluate(np.zeros((n, 3)), 0)
            assert Counted.n_made == n_made

    def test_changes_no_bit(self, make_model, assert_same_run):
        make = lambda: gym.make("Pendulum-v1", max_episode_steps=20)  # noqa: E731
        models = [make_model(CanonicalES, env).learn(500) for env in (make, make())]
        assert_same_run(*models)

    def test_a_function_that_gives_the_same_one_again_is_refused(self):
        env = Odd()
        evaluator = make_evaluator(lambda: gym.wrappers.TimeLimit(env, 5), {"net_arch": []})
        with pytest.raises(ValueError, match="`env` must be a function that makes a new env"):
            evaluator.evaluate(np.zeros((2, 3)), 0)

    def test_without_a_seed_is_one_whose_starts_differ(self):
        evaluator = make_evaluator("CartPole-v1", {"net_arch": []})
        parameters = np.zeros((20, evaluator.n_parameters))
        evaluator.evaluate(parameters, 0)
        starts = evaluator.evaluate(parameters).observations[:, 0]
        assert len(np.unique(starts, axis=0)) == 20
