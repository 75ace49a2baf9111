import inspect
import re

import gymnasium as gym
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv

from curiosity_algos import CMAME, NSES, TD3ICM, CanonicalES, CuriosityES
from curiosity_algos.loops.declared import setting
from curiosity_gym.validation import check_at_least_one

HARD = "CuriosityMaze-Hard-v0"


class TestSignatures:
    def test_every_keyword_is_shown_and_taken(self, algorithm, make_model, make_easy_maze):
        shown = inspect.signature(algorithm).parameters
        common = {"env", "policy", "seed", "device", "verbose", "tensorboard_log", "policy_kwargs"}
        assert set(shown) >= common
        assert not any(each.kind is each.VAR_KEYWORD for each in shown.values())
        defaults = {n: each.default for n, each in shown.items() if each.default is not each.empty}
        model = make_model(algorithm, make_easy_maze(), **defaults)
        twin = algorithm(make_easy_maze())
        for name in defaults.keys() & vars(model).keys() - {"policy", "evaluator", "action_noise"}:
            assert getattr(model, name) == getattr(twin, name) or name == "archive"

    def test_an_env_is_needed(self, algorithm):
        for env in (None, 3, gym.spaces.Discrete(2)):
            with pytest.raises(ValueError, match="`env` must be an environment id"):
                algorithm(env)

    def test_numbers_of_numpy_are_numbers(self, algorithm, make_model, make_easy_maze):
        settings = make_model(algorithm, make_easy_maze()).__dict__
        numbers = {
            name: np.asarray(value)[()]
            for name, value in settings.items()
            if type(value) in (int, float) and name in inspect.signature(algorithm).parameters
        }
        assert {"seed", "learning_rate"} & numbers.keys()
        model = make_model(algorithm, make_easy_maze(), **numbers).learn(1000)
        assert not [name for name in numbers if isinstance(getattr(model, name), np.generic)]

    @pytest.mark.parametrize("algorithm", [CanonicalES])
    @pytest.mark.parametrize(
        ("name", "values"),
        [
            ("total_timesteps", [-1, float("nan"), float("inf"), -1e-9, "1"]),
            ("log_interval", [0, 1.5, "1"]),
        ],
    )
    def test_errors_name_what_learn_is_given(self, algorithm, make_model, make_maze, name, values):
        model = make_model(algorithm, make_maze())
        for value in values:
            with pytest.raises(ValueError, match=f"`{name}` must be"):
                model.learn(**({"total_timesteps": 10} | {name: value}))
        assert model.num_timesteps == 0

    def test_parents_keywords_come_after_ones_own(self):
        strategy = {"population_size", "n_parents", "sigma", "learning_rate", "step", "search"}
        for algorithm in (CuriosityES, NSES):
            assert inspect.signature(algorithm).parameters.keys() >= strategy | {"phi", "n_threads"}
        assert list(inspect.signature(NSES).parameters)[:4] == ["env", "policy", "k", "behavior"]

    def test_the_nearest_default_counts(self):
        assert inspect.signature(CMAME).parameters["sigma"].default == 0.1

    def test_an_unknown_keyword_is_refused(self, algorithm, make_easy_maze):
        name = algorithm.__name__
        for keyword, end in [("policy_kwarg", ": did you mean policy_kwargs?"), ("qqq", ".")]:
            message = f"{name} got an unexpected keyword argument '{keyword}'{end}"
            with pytest.raises(TypeError, match=f"^{re.escape(message)}$"):
                algorithm(make_easy_maze(), **{keyword: {}})

    def test_ones_own_keywords_are_suggested_and_taken(self):
        class Own(CuriosityES):
            def __init__(self, env, *, wind=0.0, **kwargs):
                self.wind, self.rain = wind, kwargs.pop("rain", 0.0)
                super().__init__(env, **kwargs)

        assert Own(HARD, rain=2.0).rain == 2.0
        for keyword, near in [("winds", "wind"), ("populaton_size", "population_size")]:
            with pytest.raises(TypeError, match=rf"Own got .* did you mean {near}\?"):
                Own(HARD, **{keyword: 3})

    def test_a_class_of_ones_own_declares_settings(self, tmp_path):
        class Own(NSES):
            pace = setting(1, check_at_least_one)
            wind: float = setting(0.5, fixed=True)
            sigma: float = setting(0.2)

        shown = inspect.signature(Own).parameters
        assert [*shown][:5] == ["env", "policy", "pace", "wind", "sigma"]
        assert (shown["wind"].annotation, shown["sigma"].default) == (float, 0.2)
        model = Own(HARD, pace=np.int64(3), wind=2.0)
        assert (type(model.pace), model.pace, model.wind, model._search.sigma) == (int, 3, 2.0, 0.2)
        with pytest.raises(ValueError, match="`pace` must be a whole number"):
            model.pace = 0
        with pytest.raises(ValueError, match="`wind` must stay as it was set"):
            model.wind = 3.0
        model.save(tmp_path / "model")
        assert Own.load(tmp_path / "model", pace=4).pace == 4
        with pytest.raises(ValueError, match=r"`wind` must be left as it was saved, 2\.0"):
            Own.load(tmp_path / "model", wind=3.0)

    def test_a_mixin_may_come_first(self):
        class Logged:
            def __init__(self, log_dir="runs", *args, **kwargs):
                super().__init__(**kwargs)

        class Own(Logged, CuriosityES):
            pass

        shown = inspect.signature(Own).parameters
        assert next(iter(shown)) == "log_dir"
        assert shown["env"].kind is inspect.Parameter.KEYWORD_ONLY


class TestFromPreset:
    def test_it_is_found_for_every_kind_of_env(self):
        envs = [
            HARD,
            f"curiosity_gym:{HARD}",
            gym.make("Maze-Hard-v0"),
            gym.make_vec(HARD, num_envs=2),
            DummyVecEnv([lambda: gym.make(HARD)]),
        ]
        assert [CuriosityES.from_preset("paper", env).sigma for env in envs] == [0.5] * len(envs)
        assert CuriosityES(HARD).sigma != 0.5

    def test_what_is_given_counts_more(self):
        model = CuriosityES.from_preset("paper", HARD, sigma=0.3)  # its default, said aloud
        assert (model.sigma, model.learning_rate, model.step) == (0.3, 1.0, "paper")

    def test_keywords_of_a_bonus_are_merged_or_those_of_another_bonus(self):
        given = CuriosityES.from_preset("paper", HARD, bonus_kwargs={"learning_rate": 1e-5})
        assert given.bonus_kwargs == {"learning_rate": 1e-5, "beta": 0.2, "normalize": False}
        assert CuriosityES.from_preset("paper", HARD, bonus="rnd").bonus_kwargs == {}

    def test_a_class_of_ones_own_has_the_preset_of_what_it_extends(self):
        class Own(NSES):
            def __init__(self, env, *, pace=1, **kwargs):
                self.pace = pace
                super().__init__(env, phi=0.0, **kwargs)

        model = Own.from_preset("tuned", HARD, pace=2)
        assert (type(model), model.pace, model.phi) == (Own, 2, 0.0)

    def test_a_model_knows_its_preset(self, tmp_path):
        assert NSES(HARD).preset is None
        NSES.from_preset("paper", HARD).save(tmp_path / "model")
        assert NSES.load(tmp_path / "model").preset == "paper"

    def test_what_it_says_nothing_of_is_refused(self):
        with pytest.raises(ValueError, match="not for Pendulum-v1"):
            CuriosityES.from_preset("paper", "Pendulum-v1")
        with pytest.raises(ValueError, match="not for CuriosityMaze-Labyrinth-v0"):
            TD3ICM.from_preset("paper", "CuriosityMaze-Labyrinth-v0")
        with pytest.raises(ValueError, match="`preset` must be one of paper, tuned, got 3"):
            TD3ICM.from_preset(3, HARD)
