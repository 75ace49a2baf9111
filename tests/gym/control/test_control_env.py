import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.utils.env_checker import check_env
from scripts import run_python
from stable_baselines3.common.env_checker import check_env as sb3_check_env

from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.core import SimulationError
from curiosity_gym.registration import SPECS

pytestmark = pytest.mark.extra("control")

IDS = {spec["kwargs"]["task"]: env_id for env_id, spec in SPECS.items() if "Control" in env_id}
INFINITE = "error", "ignore:.*observation space (min|max)imum value is.*inf"
"""What Gymnasium's check says of positions and speeds is no error."""
SIZES = {"ball_in_cup": (8, 2, 4, 50), "finger": (12, 2, 3, 50), "stacker": (42, 5, 2, 100)}


class TestEveryTask:
    @pytest.mark.filterwarnings(*INFINITE)
    @pytest.mark.parametrize("random_start", [False, True])
    def test_passes_the_checks_of_gymnasium_and_stable_baselines(self, name, random_start):
        env = gym.make(IDS[name], random_start=random_start)
        check_env(env.unwrapped, skip_render_check=True)
        sb3_check_env(env)

    def test_has_the_documented_spaces(self, name):
        env = gym.make(IDS[name])
        n_observations, n_actions, n_behavior, fps = SIZES[name]
        assert env.observation_space == gym.spaces.Box(-np.inf, np.inf, (n_observations,))
        assert env.action_space == gym.spaces.Box(-1.0, 1.0, (n_actions,))
        assert env.unwrapped.behavior_space.shape == (n_behavior,)
        assert env.unwrapped.behavior_space.dtype == np.float64
        assert env.metadata["render_fps"] == fps
        assert env.spec.max_episode_steps is None
        assert env.unwrapped.horizon == 1000
        grid = env.unwrapped.coverage_grid
        assert grid.shape == (50,) * n_behavior
        assert grid.reachable is None

    def test_can_be_made_in_several_threads_at_once(self):
        code = (
            "from concurrent.futures import ThreadPoolExecutor\n"
            "from curiosity_gym.control.control_env import ControlEnv\n"
            "with ThreadPoolExecutor(3) as pool:\n"
            "    envs = list(pool.map(ControlEnv, ['finger', 'stacker', 'ball_in_cup']))\n"
            "print([env.reset()[0].shape[0] for env in envs])"
        )
        assert run_python(code).strip() == "[12, 42, 8]"


class TestExtra:
    def test_costs_nothing_to_the_interpreter_before_it_is_made(self):
        code = (
            "import sys, curiosity_gym, curiosity_gym.control.control_env\n"
            "import gymnasium as gym\n"
            "before = [n for n in ('mujoco', 'dm_control') if n in sys.modules]\n"
            f"gym.make({IDS['finger']!r}).reset()\n"
            "print(before, 'dm_control' in sys.modules, 'numba' in sys.modules)"
        )
        assert run_python(code).strip() == "[] True False"

    def test_without_the_extra_says_what_to_install(self):
        code = (
            "import sys\n"
            "sys.modules['dm_control'] = None\n"
            "import curiosity_gym, gymnasium as gym\n"
            "try:\n"
            f"    gym.make({IDS['finger']!r})\n"
            "except gym.error.DependencyNotInstalled as error:\n"
            "    print(error)"
        )
        message = run_python(code).strip()
        assert message.count("\n") == 0
        assert 'pip install "curiosity-search[control]"' in message


def test_it_raises_where_the_physics_fail_and_needs_a_reset_then():
    env = ControlEnv("ball_in_cup")
    env.reset()
    env.simulation._batch.bind("qvel")[0, 0] = 1e12
    with pytest.raises(SimulationError, match="simulation 0"):
        env.step(np.zeros(2))
    with pytest.raises(ResetNeeded):
        env.step(np.zeros(2))
    env.reset()
    assert np.isfinite(env.step(np.zeros(2))[0]).all()


def test_rejects_bad_keywords():
    for keyword, value in [
        ("task", None),
        ("task", "cheetah"),
        ("horizon", 0),
        ("horizon", 1.5),
        ("width", 0),
        ("height", -1),
        ("random_start", "yes"),
        ("random_start", None),
        ("render_mode", "human"),
    ]:
        with pytest.raises(ValueError, match=f"`{keyword}` must be"):
            ControlEnv(**({"task": "finger"} | {keyword: value}))


def test_rejects_a_keyword_of_another_task():
    with pytest.raises(TypeError, match="success_threshold"):
        ControlEnv("finger", success_threshold=0.5)
