import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import DependencyNotInstalled, ResetNeeded

from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.vector_env import ControlVectorEnv


def has_opengl():
    env = ControlEnv("finger", render_mode="rgb_array")
    env.reset()
    try:
        env.render()
    except DependencyNotInstalled:
        return False
    env.close()
    return True


needs_opengl = pytest.mark.skipif("not has_opengl()", reason="neither EGL nor OSMesa is here")


@needs_opengl
class TestFrames:
    def test_have_the_documented_size_and_show_motion(self, name, make_actions):
        env = ControlEnv(name, render_mode="rgb_array")
        env.reset()
        first = env.render()
        assert (first.shape, first.dtype) == ((240, 320, 3), np.uint8)
        np.testing.assert_array_equal(env.render(), first)
        assert len(np.unique(first.reshape(-1, 3), axis=0)) > 20
        for action in make_actions("bang-bang", 30, env.action_space.shape[0]):
            env.step(action)
        assert (env.render() != first).any(axis=-1).mean() > 1e-3
        env.reset()
        np.testing.assert_array_equal(env.render(), first)
        env.close()

    def test_show_where_the_cup_is(self):
        env = ControlEnv("ball_in_cup", render_mode="rgb_array")
        env.reset()
        columns = []
        for _ in range(20):
            orange = np.abs(env.render().astype(int) - (240, 170, 90)).sum(axis=-1) < 90
            columns.append(np.flatnonzero(orange[:80].any(axis=0)).mean())
            env.step(np.array([1.0, 0.0]))
        assert columns[-1] > columns[0] + 5  # pushed to the right
        env.close()

    def test_can_be_larger_than_the_model_says(self):
        env = ControlEnv("stacker", render_mode="rgb_array", width=1000, height=700)
        env.reset()
        assert env.render().shape == (700, 1000, 3)
        env.close()

    def test_of_several_envs_are_their_own(self):
        envs = [ControlEnv(name, render_mode="rgb_array") for name in ("finger", "stacker")]
        frames = []
        for env in envs:
            env.reset()
            frames.append(env.render())
        for env, frame in zip(envs, frames, strict=True):
            np.testing.assert_array_equal(env.render(), frame)
            env.close()

    def test_of_a_vector_env_are_those_of_single_envs(self, make_actions):
        envs = ControlVectorEnv("finger", num_envs=2, render_mode="rgb_array")
        single = ControlEnv("finger", render_mode="rgb_array")
        envs.reset()
        single.reset()
        for action in make_actions("bang-bang", 20, 2):
            envs.step(np.stack([-action, action]))
            single.step(action)
        frames = envs.render()
        np.testing.assert_array_equal(frames[1], single.render())
        assert (frames[0] != frames[1]).any()
        envs.close()
        single.close()

    def test_after_close_are_drawn_anew(self):
        env = ControlEnv("finger", render_mode="rgb_array")
        env.reset()
        first = env.render()
        env.close()
        np.testing.assert_array_equal(env.render(), first)
        env.close()

    def test_become_videos(self, tmp_path):
        env = gym.make("CuriosityControl-Finger-v0", render_mode="rgb_array", horizon=10)
        env = gym.wrappers.RecordVideo(env, str(tmp_path), episode_trigger=lambda _: True)
        env.reset()
        while not env.step(env.action_space.sample())[3]:
            pass
        env.close()
        assert [path.suffix for path in tmp_path.iterdir()] == [".mp4"]

    def test_show_in_gymnasiums_window(self):
        pytest.importorskip("pygame")
        env = gym.make("CuriosityControl-Finger-v0", render_mode="rgb_array")
        env = gym.wrappers.HumanRendering(env)
        env.reset()
        env.step(env.action_space.sample())
        env.close()


def test_without_opengl_one_sentence_says_what_to_install(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    env = ControlEnv("finger", render_mode="rgb_array")
    env.reset()
    with pytest.raises(DependencyNotInstalled, match="install EGL or OSMesa") as raised:
        env.render()
    assert "\n" not in str(raised.value)


def test_rendering_needs_a_mode_and_an_episode():
    with pytest.raises(ResetNeeded):
        ControlEnv("finger", render_mode="rgb_array").render()
    with pytest.warns(UserWarning, match="render_mode"):
        assert ControlEnv("finger").render() is None
