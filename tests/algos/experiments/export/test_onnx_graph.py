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


def make_session(source):
    return onnxruntime.InferenceSession(source, providers=["CPUExecutionProvider"])


def session_of(policy):
    graph = policy_graph(policy.mlp, policy.vector, policy.action_space)
    return make_session(graph.SerializeToString())


def run_graph(session, observations):
    (actions,) = session.run(None, {"observation": observations.astype(np.float32)})
    return actions


@pytest.mark.parametrize("net_arch", [[], [5], [32, 16]])
@pytest.mark.parametrize("env_id", ["CartPole-v1", "CuriosityMaze-US-v0"])
def test_it_decides_as_predict(env_id, net_arch):
    env = gym.make(env_id)
    policy = MlpPolicy(env.observation_space, env.action_space, net_arch)
    policy.vector[:] = np.random.default_rng(2).normal(0.0, 0.3, policy.vector.size)
    observations = np.random.default_rng(1).standard_normal((1000, *env.observation_space.shape))
    expected, _ = policy.predict(observations)
    session = session_of(policy)
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
    policy = MlpPolicy(gym.spaces.Box(-1.0, 1.0, (3,)), space, [])
    policy.vector[:] = 1000.0
    actions = run_graph(session_of(policy), np.array([[1.0] * 3, [-1.0] * 3]))
    np.testing.assert_array_equal(actions, [space.high, space.low])


@pytest.mark.parametrize("name", ["choices", "bits", "discrete", "matrix", "tuple"])
def test_other_actions_are_refused(name, make_model, register_toy, tmp_path):
    make_model(CanonicalES, register_toy(name)).learn(30, SaveRun(tmp_path / "run"))
    with pytest.raises(ValueError, match="`action_space` must be a Box"):
        export_onnx(tmp_path / "run", tmp_path / "policy.onnx")


def test_other_parameters_are_refused():
    env = gym.make("Pendulum-v1")
    policy = MlpPolicy(env.observation_space, env.action_space, [4])
    for wrong in (policy.vector[1:], np.full_like(policy.vector, np.nan)):
        with pytest.raises(ValueError, match=r"^`parameters` must be"):
            policy_graph(policy.mlp, wrong, policy.action_space)


@pytest.fixture
def folder(tmp_path, make_model):
    make_model(CanonicalES, "CartPole-v1").learn(1, SaveRun(tmp_path / "run"))
    return tmp_path / "run"


def test_a_runs_policy_is_the_one_that_enjoy_plays(folder, tmp_path):
    path = tmp_path / "new" / "best.onnx"
    export_onnx(folder, path)
    session, env = make_session(path), gym.make("CartPole-v1")
    observation, _ = env.reset(seed=3)
    total, ended = 0.0, False
    while not ended:
        (action,) = run_graph(session, observation[None])
        observation, reward, terminated, truncated, _ = env.step(action)
        total, ended = total + reward, terminated or truncated
    assert total == play(folder, seed=3).mean_return


@pytest.mark.filterwarnings("ignore:run.json cannot say")
def test_no_environment_is_needed(tmp_path, make_model, register_toy):
    env = gym.wrappers.TransformReward(gym.make(register_toy("goal")), abs)
    make_model(CanonicalES, env).learn(1, SaveRun(tmp_path / "run"))
    export_onnx(tmp_path / "run", tmp_path / "best.onnx")
    assert make_session(tmp_path / "best.onnx").get_inputs()[0].shape == ["n", 7]


def test_a_run_that_takes_a_checkpoint_meanwhile(folder, tmp_path, monkeypatch):
    last = RunFolder(folder).checkpoint
    found = iter([last.with_name("0"), last, last])
    monkeypatch.setattr(RunFolder, "checkpoint", property(lambda self: next(found)))
    export_onnx(folder, tmp_path / "best.onnx")


def test_wrong_runs_and_names_are_refused(folder, tmp_path, make_model):
    env = gym.make("Pendulum-v1", max_episode_steps=20)
    make_model(TD3ICM, env).learn(20, SaveRun(tmp_path / "td3"))
    damaged = RunFolder(folder).checkpoint / "model.zip"
    damaged.write_bytes(damaged.read_bytes()[:-40])
    for run, name, match in [
        (folder, "best.txt", r"^`out` must end in \.onnx"),
        (folder, "best.onnx", "must be a saved CanonicalES"),
        (tmp_path / "td3", "best.onnx", "of an algorithm that evolves policies"),
    ]:
        with pytest.raises(ValueError, match=match):
            export_onnx(run, tmp_path / name)
    assert not any(tmp_path.glob("best.*"))
