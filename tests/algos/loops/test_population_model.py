"""A model in a file: made again with its settings, and brought to its state."""

import io
import warnings
import zipfile

import gymnasium as gym
import numpy as np
import pytest
from saved_files import rewrite, with_about
from stable_baselines3 import PPO

from curiosity_algos import (
    AURORA,
    ICM,
    NSES,
    CanonicalES,
    CuriosityES,
    CuriosityMAPElites,
    MAPElites,
)
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.loops.model_file import load_policy
from curiosity_algos.state.file import read, save
from tests.algos.conftest import SETTINGS


class MyPolicy(MlpPolicy):
    """A user's own."""


@pytest.fixture
def path(tmp_path):
    return tmp_path / "model.zip"


@pytest.fixture
def saved(make_model, make_easy_maze, path):
    model = make_model(CuriosityES, make_easy_maze()).learn(600)
    model.save(path)
    return model


def test_an_env_that_could_not_be_set_changes_none(make_model, make_easy_maze, path, monkeypatch):
    own = make_model(CanonicalES, make_easy_maze()).evaluator
    model = make_model(CanonicalES, make_easy_maze(), evaluator=own)
    env = model.env

    def fail(*arguments):
        raise ConnectionError

    with monkeypatch.context() as context:
        context.setattr(model, "_choose_evaluator", fail)
        with pytest.raises(ConnectionError):
            model.set_env(make_easy_maze())
    assert (model.env, model.evaluator) == (env, own)
    model.save(path)
    with pytest.raises(ValueError, match="`evaluator` must be given to `load`"):
        CanonicalES.load(path, make_easy_maze())
    assert CanonicalES.load(path).evaluator is None  # which only plays


class TestSave:
    def test_names_get_stable_baselines_suffix(self, saved, tmp_path):
        saved.save(tmp_path / "one")
        saved.save(tmp_path / "model.best")
        assert {file.name for file in tmp_path.iterdir()} == {"model.zip", "one.zip", "model.best"}
        assert CuriosityES.load(tmp_path / "one").generation == saved.generation

    def test_a_file_in_memory_will_do(self, saved, assert_same_run):
        file = io.BytesIO()
        saved.save(file)
        assert_same_run(saved, CuriosityES.load(file))

    def test_the_buffer_may_stay_out(self, make_model, make_maze, tmp_path):
        model = make_model(CuriosityES, make_maze(), buffer_size=10_000, n_transitions=500)
        model.learn(1)
        model.save(tmp_path / "whole")
        model.save(tmp_path / "light", exclude=["buffer", "policy_kwargs"])
        assert len(model._motivation.buffer) == 3000
        sizes = [(tmp_path / f"{name}.zip").stat().st_size for name in ("light", "whole")]
        assert sizes[0] < sizes[1] - 3000 * 4
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            loaded = CuriosityES.load(tmp_path / "light", env=make_maze())
            CuriosityES.load(tmp_path / "whole", env=make_maze()).learn(1)
        assert len(loaded._motivation.buffer) == 0
        with pytest.warns(UserWarning, match="was saved without its buffer, which begins empty"):
            loaded.learn(1, reset_num_timesteps=False)
        assert len(loaded._motivation.buffer) == 3000


class TestLoad:
    def test_everything_comes_back(
        self, algorithm, make_model, make_easy_maze, path, assert_same_run
    ):
        model = make_model(algorithm, make_easy_maze()).learn(1000)
        model.save(path)
        loaded = algorithm.load(path)
        assert_same_run(model, loaded)
        observation, _ = make_easy_maze().reset()
        assert (loaded.predict(observation)[0] == model.predict(observation)[0]).all()
        for name, value in vars(model).items():
            if isinstance(value, int | float | str | None) and name not in {"n_envs", "start_time"}:
                assert getattr(loaded, name) == value, name

    def test_a_loaded_model_needs_an_env_to_learn(self, algorithm, make_model, make_maze, path):
        make_model(algorithm, make_maze()).learn(1).save(path)
        loaded = algorithm.load(path)
        with pytest.raises(ValueError, match="`env` must be set"):
            loaded.learn(1)
        loaded.set_env(make_maze())
        before = loaded.num_timesteps
        assert loaded.learn(1, reset_num_timesteps=False).num_timesteps == 2 * before > 0

    def test_coverage_starts_anew_in_another_maze(self, make_model, make_maze, path):
        model = make_model(CuriosityES, make_maze()).learn(1)
        model.save(path)
        assert CuriosityES.load(path, env=make_maze()).coverage == model.coverage > 0
        other = make_maze(layout="snake")
        loaded = CuriosityES.load(path, env=other)
        assert loaded.coverage == 0.0
        assert loaded._coverage_grid == other.unwrapped.coverage_grid

    def test_other_spaces_are_refused(self, saved, path):
        with pytest.raises(ValueError, match="spaces do not match"):
            CuriosityES.load(path, env=gym.make("CartPole-v1"))

    def test_settings_may_change(self, saved, path, make_easy_maze):
        assert CuriosityES.load(path, env=make_easy_maze(), n_threads=1).n_threads == 1
        with pytest.raises(ValueError, match="`n_threads` must be"):
            CuriosityES.load(path, env=make_easy_maze(), n_threads=0)
        with pytest.raises(TypeError, match=r"unexpected .* 'gama': did you mean gamma\?"):
            CuriosityES.load(path, gama=0.5)

    def test_what_the_state_was_made_with_stays(self, make_maze, path):
        NSES(make_maze(), population_size=4).learn(1).save(path)
        others = {"behavior": "state", "policy_kwargs": {"net_arch": [4]}}
        for name, value in others.items():
            for given in ({name: value}, {"custom_objects": {name: value}}):
                with pytest.raises(
                    ValueError, match=f"^`{name}` must be left as it was saved, .*NSES"
                ):
                    NSES.load(path, env=make_maze(), **given)
        for same in (None, {}, {"net_arch": (32, 16)}, {"net_arch": [32, 16]}):
            overrides = {"behavior": "final", "policy_kwargs": same}
            assert NSES.load(path, env=make_maze(), **overrides).generation == 1

    @pytest.mark.parametrize(
        ("algorithm", "other"),
        [
            (AURORA, {"latent_size": 3}),
            (CanonicalES, {"normalize_observations": True}),
            (MAPElites, {"n_cells": 3}),
            (CuriosityES, {"bonus": "rnd"}),
            (CuriosityMAPElites, {"bonus": "rnd"}),
        ],
    )
    def test_so_does_what_parts_were_made_with(self, algorithm, other, make_model, make_maze, path):
        make_model(algorithm, make_maze()).save(path)
        with pytest.raises(
            ValueError, match=f"^`{next(iter(other))}` must be left as it was saved"
        ):
            algorithm.load(path, **other)

    def test_stand_ins_of_rl_zoo3_are_ignored(self, saved, path):
        custom = {"learning_rate": 0.0, "lr_schedule": lambda _: 0.0, "clip_range": 1, "sigma": 0.1}
        loaded = CuriosityES.load(path, custom_objects=custom)
        assert (loaded.learning_rate, loaded.sigma) == (saved.learning_rate, 0.1)

    def test_spaces_of_ones_own_need_an_env(self, make_model, path):
        class Own(gym.spaces.Box):
            pass

        env = gym.make("CartPole-v1").unwrapped
        env.observation_space = Own(-1.0, 1.0, (4,))
        make_model(CuriosityES, env).save(path)
        with pytest.raises(ValueError, match="`env` must be given to `load`"):
            CuriosityES.load(path)
        assert CuriosityES.load(path, env=env).generation == 0


class TestObjects:
    """No file holds them: they are given to `load` again."""

    def test_a_policy_of_ones_own(self, make_model, make_maze, path, assert_same_run):
        model = make_model(CuriosityES, make_maze(), policy=MyPolicy).learn(1)
        model.save(path)
        with pytest.raises(ValueError, match=r"`policy` must be given to `load` .*MyPolicy"):
            CuriosityES.load(path)
        loaded = CuriosityES.load(path, env=make_maze(), policy=MyPolicy)
        assert loaded.policy_class is MyPolicy is type(loaded.policy)
        assert_same_run(loaded, model)

    def test_a_policy_may_be_named(self, saved, path, assert_same_run):
        assert_same_run(CuriosityES.load(path, policy="MlpPolicy"), saved)

    @pytest.mark.parametrize("algorithm", [CuriosityES, CuriosityMAPElites])
    def test_a_bonus(self, algorithm, make_model, make_maze, path, assert_same_run):
        env = make_maze()

        def make_bonus():
            return ICM(env.observation_space, env.action_space, seed=7, device="cpu")

        model = make_model(algorithm, env, bonus=make_bonus()).learn(1)
        model.save(path)
        with pytest.raises(ValueError, match=r"`bonus` must be given to `load` .*ICM"):
            algorithm.load(path)
        bonus = make_bonus()
        loaded = algorithm.load(path, env=make_maze(), bonus=bonus)
        assert loaded.bonus is bonus is loaded._motivation.bonus
        for one in (model, loaded):
            one.learn(300, reset_num_timesteps=False)
        assert_same_run(model, loaded)

    def test_an_object_that_it_was_saved_without_is_refused(self, make_easy_maze, path):
        search = CanonicalES(make_easy_maze(), population_size=4)._search
        CanonicalES(make_easy_maze(), population_size=4).save(path)
        with pytest.raises(ValueError, match=r"`search` must be given to `load` as to .*, none"):
            CanonicalES.load(path, search=search)

    def test_what_a_user_gave_is_in_its_part_alone(self, make_easy_maze):
        search = CanonicalES(make_easy_maze(), population_size=4)._search
        model = CanonicalES(make_easy_maze(), search=search)
        assert model.search is model._search is search
        np.testing.assert_array_equal(model.get_parameters()["search"]["center"], search.center)


class Remembering(CanonicalES):
    """Has a setting, a part, a generator and a number of its own, and a setting that is fixed."""

    _progress = (*CanonicalES._progress, "_n_heard")

    def __init__(self, env, policy="MlpPolicy", *, pace=1, **kwargs):
        self.pace = pace
        self._n_heard = 0
        self._rng = np.random.default_rng()
        self._inverse = 1 / pace
        super().__init__(env, policy, population_size=4, **kwargs)

    def _parts(self):
        return {**super()._parts(), "rng": self._rng}

    def _tell(self, rollouts):
        self._n_heard += 1
        return super()._tell(rollouts)


class Wide(CanonicalES):
    """Transforms a setting."""

    def __init__(self, env, policy="MlpPolicy", *, sigma=0.1, **kwargs):
        super().__init__(env, policy, sigma=2 * sigma, **kwargs)


class TestAClassOfOnesOwn:
    def test_a_setting_that_it_transforms_is_transformed_once(self, make_easy_maze, path):
        model = Wide(make_easy_maze(), sigma=0.2)
        model.save(path)
        loaded = Wide.load(path, env=make_easy_maze())
        assert loaded.sigma == loaded._search.sigma == 0.4
        loaded.sigma = 0.3
        loaded.save(path)
        assert Wide.load(path).sigma == 0.3
        assert Wide.load(path, sigma=0.25).sigma == 0.5

    def test_it_goes_on(self, make_easy_maze, path, assert_resumes):
        model = Remembering(make_easy_maze(), pace=4, seed=0).learn(500)
        loaded = assert_resumes(model, make_easy_maze())
        assert (loaded.pace, loaded._inverse, loaded.population_size) == (4, 0.25, 4)
        assert loaded._n_heard == model._n_heard > 0
        assert loaded._rng.random() == model._rng.random()

    def test_a_fixed_setting_that_was_changed_is_saved(self, make_easy_maze, path):
        model = Remembering(make_easy_maze())
        model.population_size = 6
        model.save(path)
        assert Remembering.load(path).population_size == 6


class TestWrongFiles:
    def test_a_model_of_stable_baselines(self, path):
        PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8).save(path)
        with pytest.raises(ValueError, match=r"must be a saved CuriosityES, .* not a whole one"):
            CuriosityES.load(path)

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("observation_space", {"Box": [0, 1]}),
            ("coverage_grid", 3),
            ("keywords", 3),
            ("keywords", {"_evil": 3}),
            ("attributes", {"population_size": "x"}),
        ],
    )
    def test_settings_that_are_damaged(self, saved, path, name, value):
        def change(about):
            before = about["settings"][name]
            is_part = name in ("keywords", "attributes") and isinstance(value, dict)
            about["settings"][name] = before | value if is_part else value

        rewrite(path, with_about(change))
        with pytest.raises((TypeError, ValueError), match=r"`|argument"):
            CuriosityES.load(path)

    @pytest.mark.parametrize(
        ("part", "change"),
        [
            ("policy", lambda state: {}),
            ("policy", lambda state: {"flat": state["flat"][:-1]}),
            ("coverage", lambda state: state | {"visited": state["visited"] + 10**9}),
            ("episodes", lambda state: {"rng": "{}"}),
            ("firsts", lambda state: {"reward": "x", "success": None}),
            ("search", lambda state: state | {"center": state["center"][:-1]}),
            ("fitness", lambda state: state | {"waited": "x"}),
            ("best", lambda state: state | {"value": np.nan}),
            ("progress", lambda state: state | {"num_timesteps": "x"}),
            ("progress", lambda state: state | {"learn": 3}),
            ("unknown", lambda state: {}),
        ],
    )
    def test_states_that_do_not_fit(self, saved, path, part, change):
        settings, state = read(path, "CuriosityES")
        save(path, "CuriosityES", settings, state | {part: change(state.get(part))})
        with pytest.raises(ValueError, match=r"^`path` must be a saved Cur.*model\.zip: "):
            CuriosityES.load(path)

    @pytest.mark.parametrize("algorithm", [CuriosityES, MAPElites])
    def test_a_part_that_is_missing(self, algorithm, make_model, make_easy_maze, path):
        make_model(algorithm, make_easy_maze()).save(path)
        settings, state = read(path, algorithm.__name__)
        for part in state:
            rest = {name: value for name, value in state.items() if name != part}
            save(path, algorithm.__name__, settings, rest)
            with pytest.raises(ValueError, match=f"a saved .*`{part}`, which is missing"):
                algorithm.load(path)


def test_nothing_in_a_file_is_pickled(make_model, make_maze, path):
    for algorithm in SETTINGS:
        make_model(algorithm, make_maze()).learn(1).save(path)
        with np.load(path) as file, zipfile.ZipFile(path) as members:
            assert len(dict(file)) == len(members.namelist())


class TestPolicyAlone:
    def test_it_needs_no_search(self, make_model, make_easy_maze, path):
        env = make_easy_maze()
        search = CanonicalES(env, population_size=4)._search
        model = CanonicalES(env, population_size=4, search=search, seed=0).learn(2000)
        model.save(path)
        policy, seed = load_policy(path, CanonicalES, env)
        np.testing.assert_array_equal(policy.vector, model.policy.vector)
        assert seed == (model.best_episode_seed or 0)

    def test_one_of_ones_own_is_refused(self, make_model, make_maze, path):
        make_model(CuriosityES, make_maze(), policy=MyPolicy).save(path)
        with pytest.raises(ValueError, match="`policy` must be MlpPolicy, it is MyPolicy"):
            load_policy(path, CuriosityES, make_maze())
