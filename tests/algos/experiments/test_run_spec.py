from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest
from tracked import Tracked

from curiosity_algos.experiments import load_final_states
from curiosity_algos.experiments.run_spec import RunSpec, variant_of
from curiosity_algos.experiments.training import train

US = "CuriosityMaze-US-v0"


def test_the_folder_is_named_by_what_is_trained(tmp_path):
    for variant in ("", "phi=0.0"):
        path = RunSpec("map-elites", "module:CuriosityMaze-US-v0", 3, 1, variant=variant)
        expected = tmp_path / variant / "MAPElites" / "CuriosityMaze-US-v0" / "3"
        assert path.folder(tmp_path) == expected
    path = RunSpec("ppo", "a-v0", 0, 1, bonus="APT").folder(tmp_path)
    assert path == tmp_path / "PPO+apt" / "a-v0" / "0"
    assert RunSpec("nses", "a/b-v0", 0, 1).folder(tmp_path).parent.name == "a-b-v0"


def test_settings_name_their_folder():
    assert variant_of({}) == ""
    assert variant_of({"sigma": 0.1, "k": [5, "../a"]}) == "k=-5,-..-a-,sigma=0.1"


@pytest.mark.parametrize(
    ("run", "message"),
    [
        (RunSpec("nses", "CuriosityMaze-UZ-v0", 0, 1), r"mean CuriosityMaze-US-v0\? MODULE:ID"),
        (
            RunSpec("nses", "no_such:My-v0", 0, 1),
            "`env` no_such:My-v0 needs a module: No module named 'no_such'",
        ),
        (
            RunSpec("ppo", "walk.no:My-v0", 0, 1),
            "`env` walk.no:My-v0 needs a module: No module named 'walk.no'",
        ),
        (
            RunSpec("nses", US, 0, 1, {}, {"sigm": 1}),
            "sigm is unknown: did you mean sigma",
        ),
        (RunSpec("nses", US, 0, 1, {}, {"sigma": -1.0}), "`sigma` must be"),
        (RunSpec("nses", US, 0, 1, {}, {"preset": "best"}), "`preset` must be one of"),
        (RunSpec("td3icm", US, 0, 1, {}, {"extrinsic": "no"}), "True or False"),
        (RunSpec("nses", US, 0, 1, {}, {"device": "gpu"}), "`device` must be"),
        (RunSpec("nses", US, 0, -1), "`total_timesteps` must be finite and at least 0"),
        (
            RunSpec("nses", US, 0, 1, {"horizn": 3}),
            "`env_kwargs` must be keywords",
        ),
        (RunSpec("pp0", US, 0, 1), "`algo` pp0 is unknown: did you mean PPO"),
        (RunSpec("ppo", US, 0, 1, {"horizn": 3}), "`env_kwargs` must be keywords"),
        (RunSpec("ppo", US, 0, 1, {}, {"n_step": 3}), "n_step is unknown: did you mean n_steps"),
        (RunSpec("ppo", US, 0, 1, {}, {"preset": "paper"}), "`hyperparams` "),
        (
            RunSpec("ppo", US, 0, 1, {}, {"policy_kwargs": {"net_arch": [-1]}}),
            "`env` and `hyperparams` must fit PPO: .*negative dimension",
        ),
        (RunSpec("ppo", "Blackjack-v1", 0, 1), r"space Tuple\(.*\) is not supported"),
        (RunSpec("dqn", US, 0, 1), "`env` and `hyperparams` must fit DQN"),
        (
            RunSpec("sac", US, 0, 1, {}, {"replay_buffer_kwargs": {}}, bonus="apt"),
            "`replay_buffer_kwargs` must be left out with a `bonus`",
        ),
        (RunSpec("ppo", US, 0, 1, bonus="atp"), "`bonus` atp is unknown: did you mean apt"),
        (RunSpec("sac", US, 0, 1, bonus="e3b"), "`bonus` must be one of single transitions"),
        (RunSpec("nses", US, 0, 1, bonus="apt"), "`bonus` must be left out for NSES"),
        (RunSpec("ppo", US, 0, 1, bonus_kwargs={"weight": 1}), "`bonus_kwargs` must be left out"),
        (
            RunSpec("ppo", US, 0, 1, bonus="apt", bonus_kwargs={"wieght": 1}),
            "`bonus_kwargs` wieght is unknown: did you mean weight",
        ),
        (RunSpec("ppo", US, 0, 1, n_envs=0), "`n_envs` must be"),
        (RunSpec("nses", US, 0, 1, n_envs=2), "`n_envs` must be 1 for NSES"),
        (RunSpec("ppo", US, 0, 1, repeat_action=0), "`repeat_action` must be"),
        (RunSpec("ppo", US, 0, 1, settle=0.0), "`settle` must be finite and above 0"),
        (RunSpec("nses", US, 0, 1, settle=1e5), "`settle` must be left out for NSES"),
    ],
)
def test_mistakes_are_found_before_it_begins(run, message):
    with pytest.raises(ValueError, match=message):
        run.check()


@pytest.mark.parametrize("algorithm", ["nses", "ppo"])
@pytest.mark.parametrize("error", [TypeError, RuntimeError])
def test_errors_of_the_environment_are_its_own(algorithm, error, tracked):
    kwargs = {"fails": "__init__", "error": error.__name__}
    with pytest.raises(error, match="its own"):
        RunSpec(algorithm, tracked, 0, 1, kwargs).check()


def test_keywords_that_are_passed_on_are_the_environments_too(tracked):
    gym.register("Passed-v0", lambda **kwargs: Tracked(**kwargs))
    try:
        with pytest.raises(ValueError, match=r"^`env_kwargs` must be .*argument 'fail'\.$"):
            RunSpec("nses", "Passed-v0", 0, 1, {"fail": "step"}).check()
    finally:
        del gym.registry["Passed-v0"]


@pytest.mark.parametrize("algorithm", ["canonical_es", "ppo"])
def test_environments_are_closed(algorithm, tracked, tmp_path):
    small = {"n_steps": 4, "batch_size": 4}
    own = {"canonical_es": {"population_size": 4, "n_parents": 2}, "ppo": small}
    run = RunSpec(algorithm, tracked, 0, 4, settings=own[algorithm] | {"device": "cpu"})
    run.check()
    assert train(run, tmp_path)
    assert not train(run, tmp_path)  # which looks whether it is finished
    assert train(replace(run, timesteps=40), tmp_path)
    with pytest.raises(TypeError, match="its own"):
        train(replace(run, env_kwargs={"fails": "step"}), tmp_path / "failed")
    with pytest.raises(ValueError, match="nonsense"):
        replace(run, settings={"nonsense": 1}).make()


def test_models_leave_the_settings_of_other_runs_alone():
    policy_kwargs = {"net_arch": [4]}
    for algorithm in ("a2c", "ddpg", "sac"):
        RunSpec(algorithm, "Pendulum-v1", 0, 1, {}, {"policy_kwargs": policy_kwargs}).make()
    assert policy_kwargs == {"net_arch": [4]}


@pytest.mark.parametrize("algorithm", ["curiosity_es", "td3icm"])
def test_a_bonus_is_this_packages_own(algorithm):
    spec = RunSpec(algorithm, US, 0, 1, bonus="RND", bonus_kwargs={"learning_rate": 1e-3})
    model = spec.make()
    bonus = getattr(model, "trained_bonus", None) or model.replay_buffer.bonus
    assert type(bonus).__name__ == "RND"
    assert spec.folder("runs").parts[1] == f"{type(model).__name__}+rnd"


@pytest.mark.skipif(not hasattr(gym.wrappers, "RepeatAction"), reason="gymnasium < 1.3")
def test_this_packages_algorithms_hold_actions_too(tmp_path):
    small = {"population_size": 4, "policy_kwargs": {"net_arch": [4]}}
    run = RunSpec("map_elites", US, 0, 1, {"horizon": 60}, small, repeat_action=5)
    train(run, tmp_path)
    assert load_final_states(tmp_path)["length"].tolist() == [12] * 4


@pytest.mark.skipif(not hasattr(gym.wrappers, "RepeatAction"), reason="gymnasium < 1.3")
def test_an_action_is_held():
    once, held = (RunSpec("nses", US, 0, 1, repeat_action=n).make_single() for n in (1, 3))
    for env in (once, held):
        env.reset()
    action = np.array([1.0, 0.5], np.float32)
    for _ in range(3):
        expected = once.step(action)[0]
    np.testing.assert_array_equal(held.step(action)[0], expected)


def test_an_older_gymnasium_is_told(monkeypatch):
    monkeypatch.delattr(gym.wrappers, "RepeatAction", raising=False)
    with pytest.raises(ImportError, match=r"`repeat_action` needs gymnasium 1\.3"):
        RunSpec("nses", US, 0, 1, repeat_action=3).make_single()
