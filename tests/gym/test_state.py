"""Exact resume: what `state_dict` gives goes on bit for bit in any environment of its kind."""

import hashlib
import pickle
import subprocess
import sys
from functools import cache

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded
from gymnasium.vector import AutoresetMode
from hypothesis import given, settings
from hypothesis import strategies as st

from curiosity_gym.control.vector_env import ControlVectorEnv
from curiosity_gym.core import SimulationError
from curiosity_gym.layouts import MazeLayout
from curiosity_gym.maze.vector_env import MazeVectorEnv

MODES = list(AutoresetMode)
NEAR_GOAL = MazeLayout("near goal", 20, 20, (5, 10), (9, 10), [(8, 12, 4, 6), (8, 2, 4, 5)])
MAZE_ID, DRAWN_ID, ROBOT_ID = (
    "CuriosityMaze-v0",
    "CuriosityControl-Finger-v0, random",
    "CuriosityLocomotion-AntTrap-v0",
)
NAMES = [
    MAZE_ID,
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
KINDS = [MAZE_ID, DRAWN_ID, ROBOT_ID]


def draws(name):
    """Whether starts are drawn."""
    return "random" in name or "Locomotion" in name


KEYWORDS = {
    "CuriosityMaze-v0": {"layout": NEAR_GOAL, "horizon": 14, "max_acceleration": 20.0},
    "CuriosityControl-Stacker-v0": {"success_threshold": 1e-45, "horizon": 38},
}
"""Random actions come upon these goals: episodes end there, and at the horizon."""
N_ENVS, N_STEPS, N_LATER = 3, 100, 20


def keywords_of(name):
    """The id that a name begins with, and the keywords of its environment."""
    env_id, _, random = name.partition(", ")
    starts = {"random_start": True} if random else {}
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

    @pytest.mark.parametrize("env_id", KINDS)
    def test_needs_a_reset_first(self, env_id):
        with pytest.raises(ResetNeeded, match=r"reset\(\) before state_dict"):
            make_vec(env_id, "NextStep").state_dict()


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


def test_a_start_at_a_walls_very_edge_is_no_place_inside_it():
    layout = MazeLayout("edge", 10, 10, (1.4, 1.0), (8, 8), [(0.3, 0.0, 0.1, 3.0)])
    envs, others = MazeVectorEnv(layout), MazeVectorEnv(layout)
    envs.reset()
    others.load_state_dict(envs.state_dict())
    np.testing.assert_array_equal(*(each.step(np.zeros((1, 2)))[0] for each in (envs, others)))


class TestFrames:
    def test_of_mazes_are_those_of_the_original(self):
        envs, others = (
            make_vec("Maze-US-v0", "NextStep", render_mode="rgb_array") for _ in range(2)
        )
        envs.reset()
        play(envs, random_actions(envs.action_space, 10))
        others.load_state_dict(envs.state_dict())
        np.testing.assert_array_equal(others.render(), envs.render())

    @pytest.mark.extra("control")
    def test_of_a_control_task_are_those_of_the_original(self):
        env, other = (ControlVectorEnv("stacker", render_mode="rgb_array") for _ in range(2))
        env.reset()
        try:
            first = env.render()
        except DependencyNotInstalled:
            pytest.skip("neither EGL nor OSMesa is here")
        play(env, random_actions(env.action_space, 30))
        other.load_state_dict(env.state_dict())
        np.testing.assert_array_equal(other.render(), env.render())
        assert (first[0] != env.render()[0]).any()
        env.close()
        other.close()


CHILD = """
import hashlib, pickle, sys
import curiosity_gym
import gymnasium as gym
for env_id, keywords, state, actions in pickle.load(sys.stdin.buffer):
    env = gym.make_vec(env_id, vectorization_mode="vector_entry_point", **keywords)
    env.load_state_dict(state)
    results = [env.step(action) for action in actions]
    print(hashlib.sha256(b"".join(each[0].tobytes() for each in results)).hexdigest())
"""


@pytest.mark.extra("control")
def test_goes_on_in_another_process():
    jobs, expected = [], []
    for env_id in ("CuriosityMaze-Hard-v0", "CuriosityControl-Finger-v0"):
        env = make_vec(env_id, "NextStep", 1, horizon=100)
        actions = random_actions(env.action_space)
        env.reset()
        play(env, actions[:30])
        jobs.append((env_id, {"horizon": 100}, env.state_dict(), actions[30:]))
        bits = b"".join(each[0].tobytes() for each in play(env, actions[30:]))
        expected.append(hashlib.sha256(bits).hexdigest())
    command, data = [sys.executable, "-c", CHILD], pickle.dumps(jobs)
    ran = subprocess.run(command, input=data, capture_output=True, timeout=120, check=False)
    assert ran.stdout.decode().split() == expected, ran.stderr.decode()


@pytest.mark.extra("control")
class TestFailedPhysics:
    def test_of_one_leaves_no_state_of_many(self, assert_identical):
        envs, twins = (ControlVectorEnv("stacker", num_envs=3, n_threads=1) for _ in range(2))
        actions = random_actions(envs.action_space, 2)
        for each in (envs, twins):
            each.reset()
            each.step(actions[0])
        state = envs.state_dict()
        envs.simulation._batch.bind("qvel")[1, 0] = 1e12
        with pytest.raises(SimulationError):
            envs.step(actions[0])
        envs.reset(options={"reset_mask": np.array([False, True, False])})
        with pytest.raises(ResetNeeded):
            envs.state_dict()
        envs.load_state_dict(state)
        assert_identical(envs.step(actions[1]), twins.step(actions[1]))


HORIZON = 6
MAZE = {"layout": "hard", "horizon": HORIZON}
CONTROL = {"task": "finger", "horizon": HORIZON}
RANDOM_START = {"random_start": True}
MANY = {"num_envs": 3, "n_threads": 1}
MAKERS = {
    "mazes": lambda **changes: MazeVectorEnv(**(MAZE | MANY | changes)),
    "controls": lambda **changes: ControlVectorEnv(**(CONTROL | MANY | changes)),
    "random controls": lambda **changes: ControlVectorEnv(
        **(CONTROL | RANDOM_START | MANY | changes)
    ),
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
    "none": lambda state: None,
    "a list": lambda state: list(state.items()),
    "empty": lambda state: {},
    "a key less": lambda state: {key: state[key] for key in state if key != "physics"},
    "a key more": lambda state: state | {"seed": 0},
    "NaN": lambda state: filled(state, "physics", np.nan),
    "infinite": lambda state: filled(state, "physics", np.inf),
    "a row less": lambda state: state | {"physics": state["physics"][:-1]},
    "a dimension more": lambda state: state | {"physics": state["physics"][None]},
    "ragged": lambda state: state | {"physics": [[1.0], [1.0, 2.0]]},
    "text": lambda state: state | {"physics": "start"},
    "nothing": lambda state: state | {"physics": None},
    "another type": lambda state: state | {"physics": state["physics"].astype(np.float32)},
    "before the start": lambda state: filled(state, "steps", -1),
    "the smallest number of steps": lambda state: filled(state, "steps", np.iinfo(np.int64).min),
    "beyond the horizon": lambda state: filled(state, "steps", HORIZON + 1),
    "far beyond the horizon": lambda state: state | {"steps": 10**30},
    "at the horizon but not ended": lambda state: filled(state, "steps", HORIZON),
    "ended at the start": lambda state: filled(filled(state, "steps", 0), "ended", True),
    "part of a step": lambda state: state | {"steps": np.array(state["steps"]) + 0.5},
    "ended by a number": lambda state: state | {"ended": np.array(state["ended"]) + 1},
}
BROKEN_PLACES = {
    "in a wall": ((100.0, 15.0, 0.0, 0.0), "leave the robot 1 from walls"),
    "too near to a wall": ((100.0, 9.5, 0.0, 0.0), "leave the robot 1 from walls"),
    "at the border": ((0.5, 5.0, 0.0, 0.0), "leave the robot 1 from walls"),
    "out of the world": ((5.0, 250.0, 0.0, 0.0), "leave the robot 1 from walls"),
    "far out of the world": ((-1e300, 5.0, 0.0, 0.0), "leave the robot 1 from walls"),
    "too fast": ((100.0, 5.0, 20.5, 0.0), "not be faster than 20 per axis"),
    "not where it sees": ((100.0, 5.0, 0.0, 0.0), "be of this maze"),
}


def assert_refused(kind, broken, why=""):
    """Loading is a ValueError of one sentence, and the episode goes on as if nothing had been."""
    env, twin = twins(kind)
    for each in (env, twin):
        each.reset(seed=0)
        each.step(np.full(each.action_space.shape, 0.5, dtype=np.float32))
    with pytest.raises(ValueError, match=f"`state` must {why}") as raised:
        env.load_state_dict(broken(env.state_dict()))
    message = str(raised.value)
    assert message.endswith(".")
    assert message.count(". ") == message.count("\n") == 0
    for action in random_actions(env.action_space, 10):
        assert pickle.dumps(act(env, action)) == pickle.dumps(act(twin, action))


@pytest.mark.extra("control")
class TestRefused:
    @pytest.mark.parametrize("kind", ["mazes", "controls"])
    def test_is_what_is_beyond_the_limit_on_steps(self, kind):
        envs, limited = MAKERS[kind](), MAKERS[kind](max_episode_steps=2)
        envs.reset()
        for n_steps in (1, 2):
            envs.step(np.zeros(envs.action_space.shape, dtype=np.float32))
            if n_steps == 1:
                limited.load_state_dict(envs.state_dict())
        with pytest.raises(ValueError, match="at most 2 steps"):
            limited.load_state_dict(envs.state_dict())

    @pytest.mark.parametrize("broken", BROKEN.values(), ids=BROKEN)
    def test_is_what_is_no_state(self, broken):
        for kind in ("mazes", "random controls"):
            assert_refused(kind, broken)

    @pytest.mark.parametrize(("place", "why"), BROKEN_PLACES.values(), ids=BROKEN_PLACES)
    def test_is_where_no_robot_can_be(self, place, why):
        for row in np.eye(3, dtype=np.bool_)[:, :, None]:

            def broken(state, row=row):
                return state | {"physics": np.where(row, place, state["physics"])}

            assert_refused("mazes", broken, why)

    @pytest.mark.parametrize("wrong", [None, {}, {"bit_generator": "MT19937"}])
    def test_is_where_no_generator_can_be(self, wrong):
        def broken(state):
            return state | {"generators": [*state["generators"][:-1], wrong]}

        assert_refused("random controls", broken, "hold generators")

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

    @pytest.mark.parametrize("kind", ["mazes", "random controls"])
    def test_is_an_episode_longer_than_its_own(self, kind):
        other = MAKERS[kind](horizon=50)
        other.reset()
        play(other, np.zeros((HORIZON + 1, *other.action_space.shape), dtype=np.float32))
        assert_refused(kind, lambda _: other.state_dict())

    @pytest.mark.parametrize("kind", ["mazes", "controls"])
    def test_are_ended_envs_where_same_step_autoreset_leaves_none(self, kind):
        envs, others = MAKERS[kind](autoreset_mode="SameStep"), MAKERS[kind]()
        others.reset()
        others.step(np.zeros(others.action_space.shape, dtype=np.float32))
        envs.load_state_dict(others.state_dict())
        play(others, np.zeros((HORIZON - 1, *others.action_space.shape), dtype=np.float32))
        assert others.state_dict()["ended"].all()
        with pytest.raises(ValueError, match="`state` must hold no ended envs"):
            envs.load_state_dict(others.state_dict())
        assert envs.state_dict()["steps"].tolist() == [1, 1, 1]

    def test_leaves_an_env_that_was_never_reset_so(self):
        for kind in MAKERS:
            env, other = MAKERS[kind](), MAKERS[kind]()
            other.reset()
            with pytest.raises(ValueError, match="`state` must"):
                env.load_state_dict(filled(other.state_dict(), "physics", np.nan))
            with pytest.raises(ResetNeeded):
                env.state_dict()
