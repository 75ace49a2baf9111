import math

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from gymnasium.wrappers import RecordEpisodeStatistics, TimeLimit
from hypothesis import example, given
from hypothesis import strategies as st
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from curiosity_gym.wrappers.sparse import SparseRewardWrapper

GOAL, PIT, STUMBLE = 4, -3, 6
RIGHT, LEFT = np.array([1.0], dtype=np.float32), np.array([-1.0], dtype=np.float32)
POSITIONS = spaces.Box(-20.0, 20.0, (1,))


class Walk(gym.Env):
    """Steps along a line, paid at each; falls into a pit, and may end its own episodes early."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 1}  # noqa: RUF012

    def __init__(self, stumble=10**6):
        self.observation_space = spaces.Dict(
            {"x": spaces.Box(-20, 20, (), np.float64), "is_left": spaces.Discrete(2)}
        )
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)
        self.render_mode = "rgb_array"
        self.stumble = stumble
        self.actions = []

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        start = (options or {}).get("x", int(self.np_random.integers(2)))
        self.x, self.t = start, 0
        return self._observation(), {"x": self.x}

    def step(self, action):
        self.actions.append(action)
        self.x = min(20, self.x + 1) if action[0] > 0 else max(-20, self.x - 1)
        self.t += 1
        is_over = self.x <= PIT
        return self._observation(), 7.0, is_over, self.t == self.stumble, {"x": self.x}

    def _observation(self):
        return {"x": np.array(float(self.x)), "is_left": np.int64(self.x < 0)}

    def render(self):
        return np.zeros((2, 2, 3), dtype=np.uint8)


class Echo(gym.Env):
    """Observations drawn from a space, and actions of a space, both of the test's choice."""

    def __init__(self, observation_space, action_space=None):
        self.observation_space = observation_space
        self.action_space = action_space or spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        self.observation_space.seed(seed)
        self.raw = self.observation_space.sample()
        return self.raw, {}

    def step(self, action):
        self.action, self.raw = action, self.observation_space.sample()
        return self.raw, 0.0, False, False, {}


def at_goal(env, observation, reward, info):
    return observation["x"] == GOAL


def never(env, observation, reward, info):
    return False


def position(env, observation, info):
    return [info["x"]]


def make_walk(horizon=10, stumble=10**6, **kwargs):
    return SparseRewardWrapper(Walk(stumble), at_goal, horizon, **kwargs)


def walk_oracle(start, moves, horizon, stumble):
    """Rewards, terminations and truncations of the contract, told as a story of one walk."""
    x = start
    for t, move in enumerate(moves, start=1):
        x += move
        if x == GOAL:
            yield (horizon - t) / horizon, True, False
            return
        if x <= PIT:
            yield 0.0, True, False
            return
        if t in (horizon, stumble):
            yield 0.0, False, True
            return
        yield 0.0, False, False


class TestContract:
    @given(
        start=st.integers(-2, 3),
        moves=st.lists(st.sampled_from([1, 1, -1]), min_size=20, max_size=20),
        horizon=st.integers(1, 15),
    )
    @example(start=GOAL - 1, moves=[1] * 20, horizon=1)  # success at the last step
    def test_rewards_and_ends_are_those_of_the_specification(self, start, moves, horizon):
        env = make_walk(horizon, STUMBLE)
        _, info = env.reset(options={"x": start})
        assert info == {"x": start, "is_success": False}
        for move, expected in zip(moves, walk_oracle(start, moves, horizon, STUMBLE), strict=False):
            _, reward, terminated, truncated, info = env.step(RIGHT if move > 0 else LEFT)
            assert reward == pytest.approx(expected[0], abs=1e-15)
            assert (terminated, truncated) == expected[1:]
            assert info == {"x": env.env.x, "is_success": env.env.x == GOAL}
            kinds = type(reward), type(terminated), type(truncated), type(info["is_success"])
            assert kinds == (float, bool, bool, bool)
        assert terminated or truncated
        with pytest.raises(ResetNeeded):
            env.step(RIGHT)

    def test_success_goes_before_the_environments_own_end(self):
        env = SparseRewardWrapper(Walk(), lambda env, o, r, info: info["x"] <= PIT, 10)
        env.reset(options={"x": PIT + 1})
        _, reward, terminated, truncated, info = env.step(LEFT)
        assert (reward, terminated, truncated, info["is_success"]) == (0.9, True, False, True)

    def test_the_predicate_sees_what_the_environment_gave(self):
        seen = []

        def success(*arguments):
            seen.append(arguments)
            return False

        base = Walk()
        env = SparseRewardWrapper(base, success)
        env.reset(options={"x": 0})
        assert seen == []
        env.step(RIGHT)
        assert seen == [(base, {"x": 1.0, "is_left": 0}, 7.0, {"x": 1})]

    @pytest.mark.parametrize("part", ["env", "success", "behavior"])
    def test_an_error_ends_the_episode(self, part):
        class Trip(Walk):
            def step(self, action):
                result = super().step(action)
                check("env", self.x)
                return result

        def check(name, x):
            if name == part and x == 2:
                raise ZeroDivisionError

        def success(env, observation, reward, info):
            check("success", info["x"])
            return at_goal(env, observation, reward, info)

        def behavior(env, observation, info):
            check("behavior", info["x"])
            return [info["x"]]

        env = SparseRewardWrapper(Trip(), success, 10, behavior, POSITIONS)
        env.reset(options={"x": 1})
        with pytest.raises(ZeroDivisionError):
            env.step(RIGHT)
        with pytest.raises(ResetNeeded):
            env.step(RIGHT)
        env.reset(options={"x": 3})
        assert env.step(RIGHT)[1:3] == (0.9, True)


class TestArguments:
    @pytest.mark.parametrize(
        ("wrong", "message"),
        [
            ({"horizon": 0}, "`horizon`"),
            ({"success": "goal"}, "`success`"),
            ({"behavior": position}, "`behavior` and `behavior_space`"),
            ({"behavior_space": POSITIONS}, "`behavior` and `behavior_space`"),
            ({"behavior_names": ["x (m)"]}, "`behavior` and `behavior_space`"),
        ],
    )
    def test_errors_name_the_argument(self, wrong, message):
        with pytest.raises(ValueError, match=message):
            SparseRewardWrapper(Walk(), **{"success": at_goal} | wrong)

    @pytest.mark.parametrize(("limit", "horizon"), [(9, 10), (300, 1000)])
    def test_a_shorter_time_limit_warns_and_truncates(self, limit, horizon):
        env = RecordEpisodeStatistics(TimeLimit(TimeLimit(Walk(), limit), limit + 5))
        with pytest.warns(UserWarning, match=f"{limit} steps.*max_episode_steps={horizon}"):
            env = SparseRewardWrapper(env, never, horizon)
        env.reset(options={"x": 0})
        ends = [env.step(move)[1:4] for move in ([RIGHT, LEFT] * limit)[:limit]]
        assert ends == [(0.0, False, False)] * (limit - 1) + [(0.0, False, True)]

    def test_observations_without_a_size_are_an_error(self):
        with pytest.raises(ValueError, match=r"`env`.*flatten"):
            SparseRewardWrapper(Echo(spaces.Sequence(spaces.Discrete(3))), never)


class TestBehavior:
    def test_without_one_the_environment_keeps_its_own(self):
        maze = gym.make("CuriosityMaze-Hard-v0")
        env = SparseRewardWrapper(maze, never)
        assert env.get_wrapper_attr("behavior_space") == maze.unwrapped.behavior_space
        assert env.get_wrapper_attr("coverage_grid") is maze.unwrapped.coverage_grid
        assert env.reset()[1]["behavior"].tolist() == [195.0, 5.0, 0.0, 0.0]

    def test_another_one_hides_the_environments_grid(self):
        env = SparseRewardWrapper(
            gym.make("CuriosityMaze-Hard-v0"),
            never,
            behavior=lambda env, observation, info: info["velocity"],
            behavior_space=spaces.Box(-20.0, 20.0, (2,)),
        )
        assert env.get_wrapper_attr("coverage_grid") is None
        assert env.get_wrapper_attr("behavior_names") is None
        assert env.reset()[1]["behavior"].tolist() == [0.0, 0.0]


SPACES = {
    "scalar": spaces.Box(-2.0, 5.0, (), np.float64),
    "float64": spaces.Box(np.array([-1.0, -np.inf]), np.array([0.1, np.inf]), dtype=np.float64),
    "matrix": spaces.Box(np.arange(6, dtype=np.float32).reshape(2, 3), 9.0),
    "bytes": spaces.Box(0, 255, (2, 2), np.uint8),
    "discrete": spaces.Discrete(4, start=-1),
    "in order": spaces.Dict([("b", spaces.Discrete(2)), ("a", spaces.Box(0, 1, (2,)))]),
    "nested": spaces.Dict(
        {
            "z": spaces.Tuple([spaces.Discrete(3), spaces.Box(-1, 1, (2, 2), np.float64)]),
            "m": spaces.Dict({"y": spaces.Box(0, 1, ()), "x": spaces.MultiBinary(2)}),
        }
    ),
}


def flatten(space, value):
    """The documented order, written out."""
    if isinstance(space, spaces.Dict):
        return [x for key in space for x in flatten(space[key], value[key])]
    if isinstance(space, spaces.Tuple):
        return [x for each, part in zip(space, value, strict=True) for x in flatten(each, part)]
    if isinstance(space, spaces.Discrete):
        return [float(value == space.start + i) for i in range(space.n)]
    return np.ravel(value).tolist()


class TestObservations:
    @pytest.mark.parametrize("space", SPACES.values(), ids=SPACES)
    def test_are_flat_in_gymnasiums_order(self, space):
        env = SparseRewardWrapper(Echo(space), never)
        flat = env.observation_space
        assert isinstance(flat, spaces.Box)
        assert (flat.dtype, len(flat.shape)) == (np.float32, 1)
        observations = [env.reset(seed=3)[0]]
        raw = [env.env.raw]
        for _ in range(5):
            observations.append(env.step(0)[0])
            raw.append(env.env.raw)
        for observation, original in zip(observations, raw, strict=True):
            assert observation in flat
            assert observation.dtype == np.float32
            np.testing.assert_array_equal(observation, np.float32(flatten(space, original)))

    def test_bounds_are_carried_over(self):
        for name in ("scalar", "float64", "matrix", "bytes"):
            space = SPACES[name]
            flat = SparseRewardWrapper(Echo(space), never).observation_space
            np.testing.assert_array_equal(flat.low, space.low.ravel().astype(np.float32))
            np.testing.assert_array_equal(flat.high, space.high.ravel().astype(np.float32))

    def test_bounds_that_float32_does_not_hold_are_infinite(self):
        env = SparseRewardWrapper(Echo(spaces.Box(-1e300, 1e300, (2,), np.float64)), never)
        assert env.observation_space == spaces.Box(-np.inf, np.inf, (2,))

    def test_a_flat_float32_box_passes_as_it_is(self):
        env = SparseRewardWrapper(Echo(spaces.Box(-1.0, 1.0, (3,))), never)
        assert env.observation_space is env.env.observation_space
        assert env.reset(seed=0)[0] is env.env.raw


class TestActions:
    def test_a_box_of_doubles_is_shown_as_float32(self):
        bounds = np.array([-0.1, -np.inf]), np.array([0.1, 3.0])
        base = Echo(spaces.Box(0, 1, (1,)), spaces.Box(*bounds, dtype=np.float64))
        env = SparseRewardWrapper(base, never)
        assert env.action_space.dtype == np.float32
        np.testing.assert_array_equal(env.action_space.low, np.float32(bounds[0]))
        np.testing.assert_array_equal(env.action_space.high, np.float32(bounds[1]))
        env.reset(seed=0)
        for action in ([0.05, 1.0], env.action_space.high, env.action_space.sample()):
            env.step(np.array(action, dtype=np.float32))
            assert base.action in base.action_space

    def test_are_clipped(self):
        env = make_walk()
        env.reset()
        env.step(np.array([-50.0]))
        assert env.env.actions == [np.array([-1.0])]

    def test_infinite_ones_are_errors_and_change_nothing(self):
        for bad in [math.nan, math.inf, -math.inf]:
            env = make_walk()
            env.reset(options={"x": GOAL - 1})
            with pytest.raises(ValueError, match="`action`"):
                env.step(np.array([bad]))
            assert env.env.actions == []
            assert env.step(RIGHT)[1] == 0.9


class TestTools:
    @staticmethod
    def make():
        return make_walk(behavior=position, behavior_space=POSITIONS)

    @pytest.mark.filterwarnings("error", "ignore:.*different from the unwrapped version")
    def test_passes_the_checks_of_gymnasium_and_stable_baselines(self):
        check_env(self.make(), skip_render_check=True)
        sb3_check_env(self.make())

    def test_a_spec_makes_the_same_again(self):
        arguments = {"horizon": 300, "behavior": position, "behavior_space": POSITIONS}
        gym.register("Walk-v0", Walk)
        try:
            env = SparseRewardWrapper(gym.make("Walk-v0"), at_goal, **arguments)
            again = gym.make(env.spec)
        finally:
            del gym.registry["Walk-v0"]
        assert type(again) is SparseRewardWrapper
        assert again.horizon == 300
        assert again.get_wrapper_attr("behavior_space") == env.behavior_space
