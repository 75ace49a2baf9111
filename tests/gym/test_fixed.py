import copy
import pickle

import gymnasium as gym
import pytest

from curiosity_gym.fixed import COMMON
from curiosity_gym.maze.maze_env import MazeEnv

KINDS = {
    "CuriosityMaze-US-v0": ("goal_radius", "layout", "maze", "lidar_range", "n_beams"),
    "CuriosityControl-Stacker-v0": ("task", "success_threshold", "random_start"),
    "CuriosityLocomotion-Swimmer-v0": ("task", "behavior", "world", "env_kwargs"),
}


@pytest.mark.parametrize("env_id", KINDS)
@pytest.mark.parametrize("is_vector", [False, True])
def test_what_nothing_would_read_cannot_be_set(env_id, is_vector):
    env = gym.make_vec(env_id, 2, "vector_entry_point") if is_vector else gym.make(env_id)
    name = type(env.unwrapped).__name__
    for setting in (*KINDS[env_id], *COMMON):
        before = vars(env.unwrapped).get(setting)
        with pytest.raises(AttributeError, match=f"`{setting}` of {name} cannot be changed"):
            setattr(env.unwrapped, setting, 5)
        if not is_vector and "_space" not in setting:  # which a wrapper may have
            with pytest.raises(AttributeError, match=f"`{setting}` of {name} cannot be changed"):
                env.set_wrapper_attr(setting, 5)
        assert vars(env.unwrapped).get(setting) is before
    assert not hasattr(env.unwrapped, KINDS[env_id][1] if "Stacker" in env_id else "world_radius")
    env.close()


def test_what_each_step_reads_can():
    env = MazeEnv("us")
    env.horizon = 2
    env.reset()
    assert [env.step([0.0, 0.0])[3] for _ in range(2)] == [False, True]


def test_copies_keep_the_settings():
    env = MazeEnv("us", n_beams=3)
    for twin in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert len(twin.maze.inverse_x) == 3
        with pytest.raises(AttributeError, match="`maze` of MazeEnv"):
            twin.maze = env.maze


def test_a_subclass_has_attributes_of_its_own():
    class Growing(MazeEnv):
        def __init__(self):
            super().__init__("us")
            self.goal_radius = 1

    env = Growing()
    env.goal_radius += 1
    assert env.goal_radius == 2
