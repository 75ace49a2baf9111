import mujoco
import numpy as np
import pytest
from suite import flat, is_solved, make_actions, make_random_reference

from curiosity_gym.control.control_env import ControlEnv
from curiosity_gym.control.simulation import RandomStarts
from curiosity_gym.control.tasks import TASKS

pytestmark = pytest.mark.extra("control")

N_STARTS = 300


def draw(task, n_starts=N_STARTS):
    """Where everything is at random starts; each name an array with a row for each start."""
    model = mujoco.MjModel.from_xml_string(*task._source(task.suite))
    data, starts, rng = mujoco.MjData(model), RandomStarts(task), np.random.default_rng(0)
    rows = [look(task, model, data, starts.draw(rng)) for _ in range(n_starts)]
    return {name: np.array([row[name] for row in rows]) for name in rows[0]}


def look(task, model, data, start):
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    n = mujoco.mj_stateSize(model, kind)
    if task.target is not None:
        getattr(model, task.target)("target").pos[:] = start[n:]
    mujoco.mj_setState(model, data, start[:n], kind)
    mujoco.mj_forward(model, data)
    joints = {model.joint(i).name: data.qpos[model.joint(i).qposadr[0]] for i in range(model.njnt)}
    sites = {f"site {model.site(i).name}": data.site_xpos[i].copy() for i in range(model.nsite)}
    bodies = {f"body {model.body(i).name}": data.xpos[i].copy() for i in range(model.nbody)}
    moving = np.abs(np.concatenate([data.qvel, data.ctrl, [data.time]])).max()
    return {"contacts": data.ncon, "moving": moving, **joints, **sites, **bodies}


def assert_uniform(values, low, high):
    """Between the bounds, and not gathered anywhere in between."""
    assert low <= values.min() <= low + 0.1 * (high - low)
    assert high - 0.1 * (high - low) <= values.max() <= high
    quarters, _ = np.histogram(values, 4, (low, high))
    assert quarters.min() > 0.1 * len(values)


def solved(name, drawn):
    """Which starts are at the goal, by positions alone."""
    if name == "ball_in_cup":
        offsets = drawn["site target"] - drawn["body ball"]
        return (np.abs(offsets[:, [0, 2]]) < 0.025).all(axis=1)
    if name == "finger":
        return np.linalg.norm(drawn["site tip"] - drawn["site target"], axis=1) <= 0.03
    return np.linalg.norm(drawn["site box0"] - drawn["site target"], axis=1) < 0.01


class TestEveryTask:
    def test_begins_at_rest_without_contact_or_success(self, name):
        drawn = draw(TASKS[name](random_start=True))
        assert not drawn["contacts"].any()
        assert not drawn["moving"].any()
        assert not solved(name, drawn).any()

    def test_is_dm_controls_start_and_its_episode(self, name):
        env = ControlEnv(name, random_start=True, horizon=300)
        for seed in range(6):
            reference = make_random_reference(name, seed)
            np.testing.assert_array_equal(
                env.reset(seed=seed)[0], flat(reference.reset().observation)
            )
            for action in make_actions("bang-bang", 300, env.action_space.shape[0], seed):
                observation, _, terminated, truncated, _ = env.step(action)
                expected = reference.step(action.astype(np.float64))
                np.testing.assert_array_equal(observation, flat(expected.observation))
                assert terminated == is_solved(name, expected.reward)
                if terminated or truncated:
                    break

    def test_the_next_start_is_dm_controls_next(self, name):
        env, reference = ControlEnv(name, random_start=True), make_random_reference(name, 3)
        env.reset(seed=3)
        reference.reset()
        np.testing.assert_array_equal(env.reset()[0], flat(reference.reset().observation))

    def test_leaves_the_model_of_the_task_alone(self, name):
        task, other = TASKS[name](random_start=True), TASKS[name]()
        draw(task, 5)
        np.testing.assert_array_equal(task.model.site_pos, other.model.site_pos)
        np.testing.assert_array_equal(task.model.body_pos, other.model.body_pos)
        np.testing.assert_array_equal(task.model.qpos0, other.model.qpos0)


def test_the_ball_is_anywhere_above_the_cup():
    drawn = draw(TASKS["ball_in_cup"](random_start=True))
    assert_uniform(drawn["ball_x"], -0.2, 0.2)
    assert_uniform(drawn["ball_z"], 0.2, 0.5)
    assert not drawn["cup_x"].any()
    assert not drawn["cup_z"].any()


def test_the_finger_and_its_target_are_anywhere():
    drawn = draw(TASKS["finger"](random_start=True))
    limit = np.deg2rad(110)
    assert_uniform(drawn["hinge"], -np.pi, np.pi)
    for joint in ("proximal", "distal"):
        assert -limit <= drawn[joint].min() < -1.0
        assert 1.0 < drawn[joint].max() <= limit
    # Target and tip are on one circle around the hinge.
    hinge = drawn["body spinner"]
    target, tip = ((drawn[f"site {name}"] - hinge)[:, [0, 2]] for name in ("target", "tip"))
    radius = np.linalg.norm(target, axis=1)
    np.testing.assert_allclose(radius, radius[0])
    np.testing.assert_allclose(np.linalg.norm(tip, axis=1), radius, rtol=0.01)
    assert_uniform(np.arctan2(target[:, 0], target[:, 1]), -np.pi, np.pi)


def test_the_arm_the_box_and_its_target_are_anywhere():
    drawn = draw(TASKS["stacker"](random_start=True))
    assert_uniform(drawn["box0_x"], 0.1, 0.3)
    assert_uniform(drawn["box0_y"], 0.0, 2 * np.pi)
    assert drawn["box0_z"].min() >= 0.0
    assert 0.6 < drawn["box0_z"].max() <= 0.7
    assert drawn["arm_root"].min() < -2.5
    assert drawn["arm_root"].max() > 2.5
    np.testing.assert_array_equal(drawn["finger"], drawn["thumb"])
    assert_uniform(drawn["body target"][:, 0], -0.37, 0.37)
    np.testing.assert_allclose(drawn["body target"][:, 2], 0.022)


def test_a_start_that_is_solved_is_drawn_again(monkeypatch):
    """Of dm_control's own starts of finger one in thirteen is solved."""
    class_ = type(make_random_reference("finger", 0).task)
    begun = []
    begin = class_.initialize_episode

    def count(self, physics):
        begun.append(self)
        begin(self, physics)

    monkeypatch.setattr(class_, "initialize_episode", count)
    draw(TASKS["finger"](random_start=True), 100)
    assert 102 <= len(begun) <= 120
