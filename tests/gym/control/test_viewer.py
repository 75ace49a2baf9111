import importlib
import os

import numpy as np
import pytest
from scripts import run_without_display
from suite import make_actions

from curiosity_gym.control.control_env import ControlEnv, ControlVectorEnv

pytestmark = pytest.mark.extra("control")


def has_opengl():
    """Whether there is EGL or OSMesa, as MuJoCo itself finds them."""
    for name in ("egl", "osmesa"):
        try:
            importlib.import_module(f"mujoco.{name}").GLContext(8, 8).free()
        except Exception:
            continue
        return True
    return False


needs_opengl = pytest.mark.skipif(not has_opengl(), reason="neither EGL nor OSMesa is here")


RENDER = """
import gymnasium as gym
import curiosity_gym
try:
    env = gym.make("CuriosityControl-Finger-v0", render_mode="rgb_array")
    env.reset()
    print(env.render().shape)
except gym.error.DependencyNotInstalled as error:
    print(error)
"""


@needs_opengl
class TestFrames:
    def test_have_the_documented_size_and_show_motion(self, name):
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

    @pytest.mark.parametrize("random_start", [False, True])
    def test_of_a_vector_env_are_those_of_single_envs(self, random_start):
        keywords = {"render_mode": "rgb_array", "random_start": random_start}
        envs = ControlVectorEnv("finger", num_envs=2, **keywords)
        single = ControlEnv("finger", **keywords)
        envs.reset(seed=0)
        single.reset(seed=1)
        for action in make_actions("bang-bang", 20, 2):
            envs.step(np.stack([-action, action]))
            single.step(action)
        frames = envs.render()
        np.testing.assert_array_equal(frames[1], single.render())
        assert (frames[0] != frames[1]).any()
        envs.close()
        single.close()


@needs_opengl
def test_an_env_that_is_never_closed_leaves_no_noise():
    assert run_without_display(RENDER) == ("(240, 320, 3)\n", "")


def test_a_library_that_does_not_work_is_named_in_one_sentence():
    printed, complaint = run_without_display(RENDER, MUJOCO_GL="glfw")
    assert complaint == ""
    assert printed.count("\n") == 1
    assert "set MUJOCO_GL to egl, osmesa or" in printed
    assert "no display" in printed


@needs_opengl
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_a_forked_process_is_told_rather_than_hung():
    code = (
        RENDER
        + "import os\n"
        + "child = os.fork()\n"
        + "if child == 0:\n"
        + "    other = gym.make('CuriosityControl-Stacker-v0', render_mode='rgb_array')\n"
        + "    other.reset()\n"
        + "    for each in (other, env):\n"
        + "        try:\n"
        + "            each.render()\n"
        + "        except gym.error.Error as error:\n"
        + "            print(error, flush=True)\n"
        + "    raise SystemExit(0)\n"
        + "print(os.waitpid(child, 0)[1])\n"
    )
    printed, complaint = run_without_display(code)
    first, new, inherited, status = printed.splitlines()
    assert "spawn" in new
    assert inherited == new
    assert (first, status, complaint) == ("(240, 320, 3)", "0", "")


@needs_opengl
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_forked_processes_may_forget_what_has_drawn():
    acts = [
        "sys.exit(0)",
        "env.close(); sys.exit(0)",
        "env.close(); other.close(); os._exit(0)",
        "del env, other; gc.collect(); sys.exit(0)",
    ]
    code = (
        "import gc, os, sys\n"
        + RENDER
        + "other = gym.make('CuriosityControl-Stacker-v0', render_mode='rgb_array')\n"
        + "other.reset()\n"
        + "other.render()\n"
        + f"for act in {acts}:\n"
        + "    sys.stdout.flush()\n"
        + "    child = os.fork()\n"
        + "    if child == 0:\n"
        + "        exec(act)\n"
        + "    print(os.waitpid(child, 0)[1])\n"
    )
    assert run_without_display(code) == ("(240, 320, 3)\n" + "0\n" * len(acts), "")


@needs_opengl
def test_copies_of_an_env_that_has_rendered_render_too(duplicate):
    env = ControlEnv("finger", render_mode="rgb_array")
    env.reset()
    frame = env.render()
    twin = duplicate(env)
    np.testing.assert_array_equal(twin.render(), frame)
    envs = ControlVectorEnv("finger", num_envs=2, render_mode="rgb_array")
    envs.reset()
    envs.render()
    twins = duplicate(envs)
    np.testing.assert_array_equal(twins.render()[1], frame)
    for each in (env, twin, envs, twins):
        each.close()
