"""Every robot against Gymnasium's own environment: the same bits, whatever its options."""

import inspect

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils import seeding

from curiosity_gym.locomotion.simulation import LocomotionSimulation
from curiosity_gym.locomotion.tasks import TASKS, task_class

pytestmark = [
    pytest.mark.extra("locomotion"),
    pytest.mark.filterwarnings("ignore:compiler attribute 'settotalmass':UserWarning"),
]

EVERYWHERE = {
    "frame_skip": 2,
    "forward_reward_weight": 1.7,
    "ctrl_cost_weight": 0.3,
    "reset_noise_scale": 0.2,
    "exclude_current_positions_from_observation": False,
}
OTHERS = {
    "Ant-v5": {
        "contact_cost_weight": 0.01,
        "healthy_reward": 0.5,
        "main_body": "aux_1",  # a leg begins where the torso is
        "healthy_z_range": (0.3, 0.9),
        "contact_force_range": (-0.5, 2.0),
        "include_cfrc_ext_in_observation": False,
    },
    "HalfCheetah-v5": {},
    "Hopper-v5": {
        "healthy_reward": 0.5,
        "healthy_state_range": (-20.0, 20.0),
        "healthy_z_range": (0.9, 2.0),
        "healthy_angle_range": (-0.3, 0.3),
    },
    "Humanoid-v5": {
        "contact_cost_weight": 0.01,
        "contact_cost_range": (0.1, 3.0),
        "healthy_reward": 0.5,
        "healthy_z_range": (1.1, 2.0),
        "include_cinert_in_observation": False,
        "include_cvel_in_observation": False,
        "include_qfrc_actuator_in_observation": False,
        "include_cfrc_ext_in_observation": False,
    },
    "Swimmer-v5": {},
    "Walker2d-v5": {
        "healthy_reward": 0.5,
        "healthy_z_range": (0.9, 2.0),
        "healthy_angle_range": (-0.5, 0.5),
    },
}
"""Every option of a constructor that changes what is computed, at another value."""
NEVER_ENDS = {"terminate_when_unhealthy": False}


def make_original(env_id, **options):
    return gym.make(env_id, disable_env_checker=True, **options).unwrapped


def make_simulation(env_id, n=3, n_threads=2, behavior="position", **options):
    task = TASKS[env_id](make_original(env_id, **options), behavior=behavior)
    return LocomotionSimulation(task, n, n_threads)


def options_of(env_id, kind):
    """The options of a name."""
    all_others = EVERYWHERE | OTHERS[env_id]
    ends = "healthy_reward" in OTHERS[env_id]
    return {"default": {}, "others": all_others, "endless": NEVER_ENDS if ends else {}}[kind]


def generator(seed):
    return seeding.np_random(seed)[0]


def assert_same(ours, theirs):
    assert np.asarray(ours).dtype == np.asarray(theirs).dtype
    np.testing.assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    "kind", ["default", "others", pytest.param("endless", marks=pytest.mark.nightly)]
)
@pytest.mark.parametrize("env_id", TASKS)
def test_equals_gymnasium_over_a_thousand_steps(env_id, kind):
    options = options_of(env_id, kind)
    original, simulation = make_original(env_id, **options), make_simulation(env_id, **options)
    middle = np.array([1])
    simulation.reset(np.arange(3), [generator(seed) for seed in (1, 2, 3)])
    observation, info = original.reset(seed=2)
    rng, n_ends = np.random.default_rng(0), 0
    for t in range(1000):
        assert_same(simulation.observations[1], observation)
        for key, value in info.items():
            assert_same({**simulation.outcome, **simulation.info}[key][1], value)
        size = 1.5 if t % 3 else 0.2  # beyond the range costs, and does no more
        actions = rng.uniform(-size, size, (3, len(original.action_space.high)))
        actions = (actions * original.action_space.high).astype(np.float32)
        observation, reward, terminated, _, info = original.step(actions[1])
        ended = simulation.step(actions)
        assert simulation.rewards[1] == reward
        assert ended[1] == terminated
        assert set(info) <= {*simulation.outcome, *simulation.info}
        if terminated:
            n_ends += 1
            assert_same(simulation.observations[1], observation)
            observation, info = original.reset(seed=t)
            simulation.reset(middle, [generator(t)])
    assert (n_ends > 0) == (kind != "endless" and "healthy_reward" in OTHERS[env_id])


def test_every_option_of_the_constructor_is_taken_over_or_changes_no_number():
    for env_id in TASKS:
        original = make_original(env_id)
        named = set(inspect.signature(type(original).__init__).parameters) - {"self", "kwargs"}
        of_the_model = {"xml_file", "frame_skip"}  # taken with the model, and with the step
        of_places, of_pictures = {"main_body"}, {"default_camera_config"}
        assert (
            named - set(TASKS[env_id](original).options) <= of_the_model | of_places | of_pictures
        )
        tested = {*EVERYWHERE, *OTHERS[env_id], *NEVER_ENDS, "xml_file", "default_camera_config"}
        assert named <= tested


def test_a_model_that_was_changed_is_the_one_that_is_simulated():
    original = make_original("Hopper-v5", **NEVER_ENDS)
    original.model.opt.gravity[2] = -2.0
    simulation = LocomotionSimulation(TASKS["Hopper-v5"](original), 1)
    plain = make_simulation("Hopper-v5", n=1, **NEVER_ENDS)
    observation, _ = original.reset(seed=0)
    for each in (simulation, plain):
        each.reset(np.arange(1), [generator(0)])
    for _ in range(50):
        observation = original.step(np.zeros(3, np.float32))[0]
        for each in (simulation, plain):
            each.step(np.zeros((1, 3), np.float32))
    assert_same(simulation.observations[0], observation)
    assert (plain.observations[0] != observation).any()
    assert simulation.task != plain.task


class TestFeet:
    @pytest.mark.parametrize("env_id", [key for key in TASKS if key != "Swimmer-v5"])
    def test_counts_the_steps_at_whose_end_a_foot_touches_something(self, env_id):
        options = options_of(env_id, "endless")
        original = make_original(env_id, **options)
        simulation = make_simulation(env_id, behavior="feet", n=2, **options)
        original.reset(seed=5)
        simulation.reset(np.arange(2), [generator(4), generator(5)])
        model, rng = original.model, np.random.default_rng(1)
        feet = [model.geom(name).id for name in simulation.task.feet]
        counts, n_steps = np.zeros(len(feet)), 200
        for _ in range(n_steps):
            actions = rng.uniform(-1, 1, (2, model.nu)).astype(np.float32) * 0.4
            original.step(actions[1])
            simulation.step(actions)
            counts += np.isin(feet, list(pushed_geoms(model, original.data)))
        assert 0 < counts.sum() < n_steps * len(feet)
        np.testing.assert_allclose(simulation.behaviors[1], counts / n_steps, atol=1e-12)

    def test_each_has_its_name(self):
        task = make_simulation("Ant-v5", behavior="feet").task
        legs = ["front_left_leg", "front_right_leg", "back_leg", "right_back_leg"]
        bodies = [task.model.body(body) for body in task.foot_bodies]
        above = [task.model.body(task.model.body(body.parentid[0]).parentid[0]) for body in bodies]
        assert [body.name for body in above] == legs
        assert task.behavior_names == (
            "front left foot (share of steps)",
            "front right foot (share of steps)",
            "back left foot (share of steps)",
            "back right foot (share of steps)",
        )
        for env_id in TASKS.keys() - {"Swimmer-v5"}:
            task = make_simulation(env_id, behavior="feet").task
            assert len(task.behavior_names) == len(task.behavior_low)

    def test_is_nothing_at_the_start(self):
        simulation = make_simulation("Ant-v5", behavior="feet")
        simulation.reset(np.arange(3), [generator(0)])
        np.testing.assert_array_equal(simulation.behaviors, np.zeros((3, 4)))


def pushed_geoms(model, data):
    """Those that a contact exerts a force on."""
    import mujoco

    force = np.zeros(6)
    for i, contact in enumerate(data.contact):
        mujoco.mj_contactForce(model, data, i, force)
        if force.any():
            yield from contact.geom


def test_behaviors_are_where_the_torso_is_within_the_bounds():
    simulation = make_simulation("Ant-v5")
    simulation.reset(np.arange(3), [generator(0)])
    for data, place in zip(simulation.data, ([1.0, -2.0], [40.0, 0.5], [-31.0, 31.0]), strict=True):
        data.qpos[:2] = place
        data.qvel[:] = 0.0
    simulation.step(np.zeros((3, 8), np.float32))
    expected = [[1.0, -2.0], [30.0, 0.5], [-30.0, 30.0]]
    np.testing.assert_allclose(simulation.behaviors, expected, atol=0.05)


def test_equality_asks_for_every_option():
    for env_id in TASKS:
        plain = TASKS[env_id](make_original(env_id))
        for name, value in {
            **options_of(env_id, "others"),
            **options_of(env_id, "endless"),
        }.items():
            assert TASKS[env_id](make_original(env_id, **{name: value})) != plain, name


@pytest.mark.parametrize("env_id", ["Humanoid-v5", "Walker2d-v5"])
def test_copies_go_on_with_the_same_bits(env_id, duplicate):
    simulation = make_simulation(env_id, behavior="feet", **NEVER_ENDS)
    simulation.reset(np.arange(3), [generator(0)])
    rng = np.random.default_rng(2)
    actions = rng.uniform(-0.4, 0.4, (40, 3, simulation.task.n_actions)).astype(np.float32)
    for each in actions[:20]:
        simulation.step(each)
    twin = duplicate(simulation)
    np.testing.assert_array_equal(twin.behaviors, simulation.behaviors)
    for each in actions[20:]:
        simulation.step(each)
        twin.step(each)
        np.testing.assert_array_equal(twin.observations, simulation.observations)
        np.testing.assert_array_equal(twin.rewards, simulation.rewards)
    np.testing.assert_array_equal(twin.state, simulation.state)


def test_threads_and_neighbours_change_no_bit():
    def run(n, n_threads, ids):
        simulation = make_simulation("Ant-v5", n, n_threads, **NEVER_ENDS)
        simulation.reset(np.arange(n), [generator(0)])
        rng = np.random.default_rng(3)
        for action in rng.uniform(-1.0, 1.0, (30, 8)).astype(np.float32):
            simulation.step(np.tile(action, (len(ids), 1)), np.array(ids))
        return simulation.observations[ids]

    expected = run(1, 1, [0])
    for n, n_threads, ids in ((5, 1, [0, 3]), (5, 2, [1, 2, 4]), (9, 3, list(range(9)))):
        np.testing.assert_array_equal(run(n, n_threads, ids), np.repeat(expected, len(ids), axis=0))


def test_a_robot_that_mujoco_starts_anew_goes_on_as_in_gymnasium():
    original, simulation = make_original("HalfCheetah-v5"), make_simulation("HalfCheetah-v5", n=2)
    original.reset(seed=0)
    simulation.reset(np.arange(2), [generator(0)])
    for data in (original.data, simulation.data[1]):
        data.qvel[:] = 1e12
    actions = np.full((2, 6), 0.3, np.float32)
    for _ in range(5):
        observation, reward, *_ = original.step(actions[1])
        simulation.step(actions)
        np.testing.assert_array_equal(simulation.observations[1], observation)
        assert simulation.rewards[1] == reward
    assert original.data.warning.number.sum() > 0


def test_the_class_of_a_task_is_known_by_gymnasiums_own():
    assert all(task_class(make_original(key)) is task for key, task in TASKS.items())
    assert task_class(gym.make("Ant-v5")) is None  # it is wrapped
    assert task_class(gym.make("Pendulum-v1").unwrapped) is None
    own = type("AntEnv", (type(make_original("Ant-v5")),), {})
    assert task_class(own()) is None


def test_gymnasiums_class_is_that_of_the_id():
    assert {key: gym.spec(key).entry_point for key in TASKS} == {
        key: task.entry_point for key, task in TASKS.items()
    }
