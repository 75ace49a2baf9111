"""ONNX graphs decide as `predict` does; onnxruntime is the judge."""

import gymnasium as gym
import numpy as np
import pytest

from curiosity_algos import TD3ICM, CanonicalES
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.experiments import RunFolder, SaveRun
from curiosity_algos.experiments.export import export_onnx, policy_graph
from curiosity_algos.experiments.film import play

onnxruntime = pytest.importorskip("onnxruntime")
pytestmark = pytest.mark.extra("onnx")

ENVS = [
    "CartPole-v1",
    "CuriosityControl-Finger-v0",
    "CuriosityLocomotion-Ant-v0",
    "CuriosityMaze-US-v0",
    "Pendulum-v1",
]


def make_session(source):
    return onnxruntime.InferenceSession(source, providers=["CPUExecutionProvider"])


def run_graph(session, observations):
    (actions,) = session.run(None, {"observation": observations.astype(np.float32)})
    return actions


def make_policy(env, net_arch, seed=0):
    policy = MlpPolicy(env.observation_space, env.action_space, net_arch)
    policy.vector[:] = np.random.default_rng(seed).normal(0.0, 0.3, policy.vector.size)
    return policy


@pytest.mark.parametrize("net_arch", [[], [5], [32, 16]])
@pytest.mark.parametrize("env_id", ENVS)
def test_it_decides_as_predict(env_id, net_arch):
    extra = {"CuriosityControl": "dm_control", "CuriosityLocomotion": "mujoco"}
    if env_id.partition("-")[0] in extra:
        pytest.importorskip(extra[env_id.partition("-")[0]])
    env = gym.make(env_id)
    policy = make_policy(env, net_arch, seed=2)
    observations = np.random.default_rng(1).standard_normal((1000, *env.observation_space.shape))
    expected, _ = policy.predict(observations)
    session = make_session(
        policy_graph(policy.mlp, policy.vector, policy.action_space).SerializeToString()
    )
    actions = run_graph(session, observations)
    assert actions.dtype == expected.dtype
    if isinstance(env.action_space, gym.spaces.Discrete):
        np.testing.assert_array_equal(actions, expected)
        assert len(set(actions.tolist())) > 1
    else:
        np.testing.assert_allclose(actions, expected, atol=1e-5)
        assert all(map(env.action_space.contains, actions))
    np.testing.assert_array_equal(run_graph(session, observations[:1]), actions[:1])


def test_actions_stay_in_an_uneven_box():
    space = gym.spaces.Box(np.float32([-3.0, 0.1]), np.float32([0.7, 0.3]))
    env = gym.make("Pendulum-v1")
    policy = MlpPolicy(env.observation_space, space, [])
    policy.vector[:] = 1000.0
    observations = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]])
    graph = policy_graph(policy.mlp, policy.vector, policy.action_space).SerializeToString()
    actions = run_graph(make_session(graph), observations)
    np.testing.assert_array_equal(actions, [space.high, space.low])


def test_other_observations_are_vectors(make_model, register_toy, tmp_path):
    make_model(CanonicalES, register_toy("goal")).learn(30, SaveRun(tmp_path / "run"))
    export_onnx(tmp_path / "run", tmp_path / "goal.onnx")
    assert make_session(tmp_path / "goal.onnx").get_inputs()[0].shape == ["n", 7]


@pytest.mark.parametrize("name", ["choices", "bits", "discrete", "matrix", "tuple"])
def test_other_actions_are_refused(name, make_model, register_toy, tmp_path):
    make_model(CanonicalES, register_toy(name)).learn(30, SaveRun(tmp_path / "run"))
    with pytest.raises(ValueError, match="`action_space` must be a Box"):
        export_onnx(tmp_path / "run", tmp_path / "policy.onnx")


def test_other_parameters_are_refused():
    env = gym.make("Pendulum-v1")
    policy = make_policy(env, [4])
    for wrong in (policy.vector[1:], np.full_like(policy.vector, np.nan)):
        with pytest.raises(ValueError, match=r"^`parameters` must be"):
            policy_graph(policy.mlp, wrong, policy.action_space)


class TestRun:
    @pytest.fixture
    def folder(self, tmp_path, make_model):
        model = make_model(CanonicalES, "CartPole-v1").learn(1, SaveRun(tmp_path / "run"))
        self.model = model
        return tmp_path / "run"

    def test_it_is_the_policy_that_enjoy_plays(self, folder, tmp_path):
        path = tmp_path / "new" / "best.onnx"
        export_onnx(folder, path)
        session, env = make_session(path), gym.make("CartPole-v1")
        observation, _ = env.reset(seed=3)
        total, ended = 0.0, False
        while not ended:
            (action,) = run_graph(session, observation[None])
            assert action == self.model.predict(observation)[0]
            observation, reward, terminated, truncated, _ = env.step(action)
            total, ended = total + reward, terminated or truncated
        assert total == play(folder, seed=3)

    @pytest.mark.filterwarnings("ignore:run.json cannot say")
    def test_no_environment_is_needed(self, tmp_path, make_model):
        env = gym.wrappers.TransformReward(gym.make("CartPole-v1"), abs)
        make_model(CanonicalES, env).learn(1, SaveRun(tmp_path / "run"))
        export_onnx(tmp_path / "run", tmp_path / "best.onnx")
        assert make_session(tmp_path / "best.onnx").get_inputs()[0].shape == ["n", 4]

    def test_a_run_that_takes_a_checkpoint_meanwhile(self, folder, tmp_path, monkeypatch):
        last = RunFolder(folder).checkpoint
        found = iter([last.with_name("0"), last, last, last.with_name("0"), last, last])
        monkeypatch.setattr(RunFolder, "checkpoint", property(lambda self: next(found)))
        export_onnx(folder, tmp_path / "best.onnx")

    def test_another_ending_is_refused(self, folder, tmp_path):
        with pytest.raises(ValueError, match=r"^`out` must end in \.onnx"):
            export_onnx(folder, tmp_path / "best.txt")

    def test_a_damaged_policy_is_refused(self, folder, tmp_path):
        np.savez(RunFolder(folder).checkpoint / "best_policy.npz", parameters=np.zeros(3))
        with pytest.raises(ValueError, match="is damaged"):
            export_onnx(folder, tmp_path / "best.onnx")
        assert not (tmp_path / "best.onnx").exists()

    def test_td3_is_refused(self, tmp_path, make_model):
        env = gym.make("Pendulum-v1", max_episode_steps=20)
        make_model(TD3ICM, env).learn(20, SaveRun(tmp_path / "run"))
        with pytest.raises(ValueError, match="of an algorithm that evolves policies"):
            export_onnx(tmp_path / "run", tmp_path / "best.onnx")
