"""Exact resume: what `state_dict` gives goes on bit for bit in any environment of its kind."""

import pickle
from functools import cache

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

from curiosity_gym.control.control_env import ControlVectorEnv
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.maze_env import MazeVectorEnv

MODES = list(AutoresetMode)
NEAR_GOAL = MazeLayout("near goal", 20, 20, (5, 10), (9, 10), [(8, 12, 4, 6), (8, 2, 4, 5)])
MAZE_ID, DRAWN_MAZE_ID, DRAWN_ID, ROBOT_ID = (
    "CuriosityMaze-v0",
    "CuriosityMaze-v0, random",
    "CuriosityControl-Finger-v0, random",
    "CuriosityLocomotion-AntTrap-v0",
)
NAMES = [
    MAZE_ID,
    DRAWN_MAZE_ID,
    "CuriosityControl-BallInCup-v0",
    DRAWN_ID,
    "CuriosityControl-Stacker-v0",
    "CuriosityControl-Stacker-v0, random",
    "CuriosityLocomotion-Hopper-v0",
    "CuriosityLocomotion-Humanoid-v0",
    "CuriosityLocomotion-Swimmer-v0",
    ROBOT_ID,
]
"""One for each kind of physics."""
KINDS = [MAZE_ID, DRAWN_MAZE_ID, DRAWN_ID, ROBOT_ID]


def draws(name):
    """Whether starts are drawn."""
    return "random" in name or "Locomotion" in name


MAZE_KEYWORDS = {"layout": NEAR_GOAL, "horizon": 14, "max_acceleration": 20.0}
KEYWORDS = {
    MAZE_ID: MAZE_KEYWORDS,
    DRAWN_MAZE_ID: MAZE_KEYWORDS | {"start_radius": 3.0},
    "CuriosityControl-Stacker-v0": {"success_threshold": 1e-45, "horizon": 38},
}
"""Random actions come upon these goals: episodes end there, and at the horizon."""
N_ENVS, N_STEPS, N_LATER = 3, 100, 20


def keywords_of(name):
    """The id that a name begins with, and the keywords of its environment."""
    env_id, _, random = name.partition(", ")
    starts = {"random_start": True} if random and "Maze" not in name else {}
    return env_id, {"horizon": 14} | KEYWORDS.get(name, {}) | starts


def make(name, **changes):
    env_id, keywords = keywords_of(name)
    return gym.make(env_id, **(keywords | changes))


def make_vec(name, mode, num_envs=N_ENVS, **changes):
    env_id, keywords = keywords_of(name)
    keywords = {"n_threads": 1} | keywords | changes
    kind = {"num_envs": num_envs, "vectorization_mode": "vector_entry_point"}
    return gym.make_vec(env_id, **kind, autoreset_mode=mode, **keywords)


def random_actions(space, n_steps=N_STEPS, seed=4):
    """Of full strength, some beyond; each held for five steps, so that robots get somewhere."""
    values = np.random.default_rng(seed).uniform(-1.5, 1.5, (n_steps // 5 + 1, *space.shape))
    return np.repeat(np.sign(values) * np.sqrt(np.abs(values)), 5, axis=0)[:n_steps].astype("f4")


def act(env, action):
    """A step; a reset instead, where the episode has ended and nothing else would go on."""
    try:
        return env.step(action)
    except ResetNeeded:
        vector = isinstance(env, gym.vector.VectorEnv)
        ended = env.state_dict()["ended"] if vector else None
        return env.reset(options={"reset_mask": ended} if vector else None)


def play(env, actions):
    return [act(env, action) for action in actions]


def play_keeping_states(env, actions):
    """What the steps return, and the pickled state before each, also before the first."""
    states, results = [], []
    for action in actions:
        states.append(pickle.dumps(env.state_dict()))
        results.append(act(env, action))
    return states, results


def starts_of_interest(results, n_random=4, seed=0):
    """Where to resume: right before and after an episode's end, at the start, and anywhere."""
    n = len(results) - N_LATER
    ends = [t for t in range(n) if len(results[t]) == 5 and np.any(results[t][2] | results[t][3])]
    anywhere = np.random.default_rng(seed).integers(0, n, n_random).tolist()
    return sorted({0, ends[0], ends[0] + 1, ends[-1] + 1, *anywhere}, reverse=True)


def assert_resumes(envs, states, results, actions, assert_identical):
    """Each env in turn goes on from each state, latest first, wherever it was before."""
    for start in starts_of_interest(results):
        for env in envs:
            env.load_state_dict(pickle.loads(states[start]))
            later = slice(start, start + N_LATER)
            for ours, theirs in zip(play(env, actions[later]), results[later], strict=True):
                assert_identical(ours, theirs)


def ends(results):
    """Terminations and truncations in all."""
    steps = [result for result in results if len(result) == 5]
    return sum(np.sum(step[2]) for step in steps), sum(np.sum(step[3]) for step in steps)


class TestEveryEnvironment:
    @pytest.mark.parametrize(
        ("env_id", "mode"),
        [(name, mode) for name in NAMES for mode in (MODES if name in KINDS else MODES[:1])],
    )
    def test_resumes_bit_for_bit(self, env_id, mode, assert_identical):
        envs, fresh = (make_vec(env_id, mode) for _ in range(2))
        actions = random_actions(envs.action_space)
        envs.reset(seed=3)
        play(envs, actions[:5])
        envs.reset(options={"reset_mask": np.array([True, False, False])})
        states, results = play_keeping_states(envs, actions)
        assert_resumes((fresh, envs), states, results, actions, assert_identical)
        terminations, truncations = ends(results)
        assert truncations > 0
        assert terminations > 0 or env_id not in KEYWORDS

    @pytest.mark.parametrize("env_id", KINDS)
    def test_states_hold_new_arrays(self, env_id, assert_identical):
        envs, twins = (make_vec(env_id, AutoresetMode.NEXT_STEP, copy=False) for _ in range(2))
        observations = envs.reset(seed=3)[0]
        twins.reset(seed=3)
        state = envs.state_dict()
        assert list(state) == ["steps", "ended", "observations", "physics", "generators"]
        assert len(state["generators"]) == (N_ENVS if draws(env_id) else 0)
        assert (state["steps"].dtype, state["ended"].dtype) == (np.int64, np.bool_)
        assert_identical(state["observations"], observations)
        assert (state["physics"].dtype, len(state["physics"])) == (np.float64, N_ENVS)
        envs.load_state_dict(state)
        for key, value in {"steps": 9, "ended": 1, "observations": np.nan, "physics": 7.0}.items():
            state[key][:] = value
        for action in random_actions(envs.action_space, 20):
            assert_identical(act(envs, action), act(twins, action))


@settings(max_examples=settings.default.max_examples // 2)
@given(
    seed=st.integers(0, 2**32 - 1),
    n_before=st.integers(0, 60),
    n_elsewhere=st.integers(0, 30),
    mode=st.sampled_from(MODES),
    restitution=st.sampled_from([0.0, 0.7]),
)
def test_any_state_of_a_maze_resumes(seed, n_before, n_elsewhere, mode, restitution):
    changes = {"restitution": restitution, "n_threads": 2, "num_envs": 5}
    envs = make_vec("CuriosityMaze-v0", mode, **changes)
    actions = random_actions(envs.action_space, n_before + n_elsewhere + 30, seed)
    envs.reset()
    play(envs, actions[:n_before])
    state, later = envs.state_dict(), actions[n_before + n_elsewhere :]
    expected = pickle.dumps(play(envs, later))
    play(envs, actions[n_before:])
    envs.load_state_dict(state)
    assert pickle.dumps(play(envs, later)) == expected


@pytest.mark.parametrize(("layout", "restitution"), [("hard", 1.0), (NEAR_GOAL, 0.0)])
def test_no_place_that_a_robot_comes_to_is_refused(layout, restitution):
    envs = MazeVectorEnv(layout, num_envs=16, restitution=restitution, max_acceleration=80.0)
    envs.reset()
    start = envs.state_dict()["physics"]
    one = envs.make_single_env()
    for action in random_actions(envs.action_space, 200):
        envs.step(action)
        envs.load_state_dict(envs.state_dict())
        for state in envs.state_dict()["physics"]:
            one.reset(options={"state": state})
    assert (envs.state_dict()["physics"] != start).any(axis=1).all()


HORIZON = 6
MANY = {"num_envs": 3, "n_threads": 1, "horizon": HORIZON}
FINGER = MANY | {"task": "finger"}
MAKERS = {
    "mazes": lambda **changes: MazeVectorEnv(**(MANY | {"layout": "hard"} | changes)),
    "controls": lambda **changes: ControlVectorEnv(**(FINGER | changes)),
    "random controls": lambda **changes: ControlVectorEnv(**FINGER, random_start=True, **changes),
}


@cache
def twins(kind):
    return MAKERS[kind](), MAKERS[kind]()


def filled(state, key, value):
    """The state with one entry of one of its values replaced, of whatever shape it is."""
    array = np.array(state[key])
    array.flat[-1] = value
    return state | {key: array}


BROKEN = {
    "NaN": lambda state: filled(state, "physics", np.nan),
    "a row less": lambda state: state | {"physics": state["physics"][:-1]},
    "another type": lambda state: state | {"physics": state["physics"].astype(np.float32)},
    "before the start": lambda state: filled(state, "steps", -1),
    "at the horizon but not ended": lambda state: filled(state, "steps", HORIZON),
    "beyond the horizon": lambda state: filled(filled(state, "ended", True), "steps", HORIZON + 1),
    "a generator less": lambda state: state | {"generators": state["generators"][:-1]},
}


def assert_refused(kind, broken, why=""):
    """Loading is a ValueError of one sentence, and the episode goes on as if nothing had been."""
    env, twin = twins(kind)
    for each in (env, twin):
        each.reset(seed=0)
        each.step(np.full(each.action_space.shape, 0.5, dtype=np.float32))
    with pytest.raises(ValueError, match=f"`state` must {why}") as raised:
        env.load_state_dict(broken(env.state_dict()))
    assert str(raised.value).endswith(".")
    for action in random_actions(env.action_space, 10):
        assert pickle.dumps(act(env, action)) == pickle.dumps(act(twin, action))


@pytest.mark.extra("control")
class TestRefused:
    @pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN)
    def test_is_what_is_no_state(self, broken):
        assert_refused("random controls", broken)

    def test_is_where_no_robot_sees_that(self):
        def broken(state):
            return state | {"physics": state["physics"] + [0.0, 1.0, 0.0, 0.0]}

        assert_refused("mazes", broken, "be of this maze")

    def test_is_what_is_beyond_the_limit_on_steps(self):
        envs, limited = MAKERS["mazes"](), MAKERS["mazes"](max_episode_steps=2)
        envs.reset()
        play(envs, np.zeros((2, 3, 2), dtype=np.float32))
        with pytest.raises(ValueError, match="at most 2 steps"):
            limited.load_state_dict(envs.state_dict())

    def test_is_what_mujoco_warns_of(self):
        assert_refused("controls", lambda state: state | {"physics": state["physics"] + 1e12})

    @pytest.mark.parametrize(
        ("kind", "changes"),
        [
            ("mazes", {"n_beams": 16}),
            ("mazes", {"lidar_range": 3.0}),
            ("mazes", {"num_envs": 1}),
            ("mazes", {"layout": "snake"}),
            ("controls", {"task": "ball_in_cup"}),
            ("controls", {"random_start": True}),
            ("controls", {"num_envs": 4}),
        ],
    )
    def test_is_the_state_of_another_environment(self, kind, changes):
        other = MAKERS[kind](**changes)
        other.reset()
        assert_refused(kind, lambda _: other.state_dict())
