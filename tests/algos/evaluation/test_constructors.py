import inspect
import re

import pytest

from curiosity_algos import CMAME, NSES, CuriosityES
from curiosity_algos.evaluation.constructors import AlgorithmType

ALL = {"env", "policy", "seed", "device", "verbose", "tensorboard_log", "policy_kwargs"}
STRATEGY = {"population_size", "n_parents", "sigma", "learning_rate", "step", "search"}


def constructors(cls):
    """The constructors that keywords pass through, the class' own first."""
    for each in cls.__mro__:
        if "__init__" in vars(each):
            signature = inspect.signature(vars(each)["__init__"])
            yield signature.parameters.values()
            if not any(
                parameter.kind is parameter.VAR_KEYWORD
                for parameter in signature.parameters.values()
            ):
                return


class TestSignatures:
    def test_every_keyword_is_shown(self, any_algorithm):
        shown = inspect.signature(any_algorithm).parameters
        taken = {
            parameter.name
            for parameters in constructors(any_algorithm)
            for parameter in parameters
            if not parameter.name.startswith("_") and parameter.kind is not parameter.VAR_KEYWORD
        }
        assert set(shown) == taken - {"self"} >= ALL
        assert not any(each.kind is each.VAR_KEYWORD for each in shown.values())

    def test_every_keyword_is_taken(self, any_algorithm, make_model, make_easy_maze):
        shown = inspect.signature(any_algorithm).parameters.values()
        defaults = {each.name: each.default for each in shown if each.default is not each.empty}
        model = make_model(any_algorithm, make_easy_maze(), **defaults)
        twin = any_algorithm(make_easy_maze())
        for name in defaults.keys() & vars(model).keys() - {"policy", "evaluator", "action_noise"}:
            assert getattr(model, name) == getattr(twin, name) or name == "archive"

    def test_strategies_show_their_search(self):
        for algorithm in (CuriosityES, NSES):
            assert inspect.signature(algorithm).parameters.keys() >= STRATEGY | {"phi"}

    def test_the_nearest_default_counts(self):
        assert inspect.signature(CMAME).parameters["sigma"].default == 0.1

    def test_an_unknown_keyword_is_refused(self, any_algorithm, make_easy_maze):
        with pytest.raises(TypeError, match="sigmma"):
            any_algorithm(make_easy_maze(), sigmma=0.1)


class TestDocstrings:
    def test_every_argument_is_documented_once(self, any_algorithm):
        text = inspect.getdoc(any_algorithm)
        section = re.search(r"^Args:\n((?:    .*\n?)+)", text, re.MULTILINE)[1]
        entries = re.findall(r"^    (\w+): ", section, re.MULTILINE)
        assert entries == list(inspect.signature(any_algorithm).parameters)

    def test_nobody_is_sent_elsewhere(self, any_algorithm):
        text = inspect.getdoc(any_algorithm)
        assert "Likewise" not in text
        assert "Passed on" not in text

    def test_attributes_of_parents_are_there(self, algorithm):
        text = inspect.getdoc(algorithm)
        assert "\nAttributes:\n" in text
        assert "    best_return: " in text


def test_a_class_of_ones_own_shows_its_parents_keywords():
    class Base(metaclass=AlgorithmType):
        """Base.

        Args:
            env: Where.
            sigma: How far,
                in two lines.

        Raises:
            ValueError: Of the base.
        """

        def __init__(self, env, *, sigma=1.0, _hidden=0):
            self.made = (env, sigma)

    class Own(Base):
        """Own.

        Args:
            pace: How fast.
        """

        def __init__(self, env, *, pace=2, **kwargs):
            super().__init__(env, **kwargs)

    assert str(inspect.signature(Own)) == "(env, *, pace=2, sigma=1.0)"
    assert inspect.getdoc(Own) == (
        "Own.\n\nArgs:\n    env: Where.\n    pace: How fast.\n    sigma: How far,\n"
        "        in two lines.\n\nRaises:\n    ValueError: Of the base."
    )
    assert Own(3, sigma=4).made == (3, 4)


class TestClassesOfOnesOwn:
    def test_a_mixin_may_come_first(self):
        class Logged:
            def __init__(self, log_dir="runs", **kwargs):
                super().__init__(**kwargs)

        class Own(Logged, CuriosityES):
            pass

        shown = inspect.signature(Own).parameters
        assert list(shown)[:2] == ["log_dir", "env"]
        assert shown["env"].kind is inspect.Parameter.KEYWORD_ONLY

    def test_env_may_have_a_default(self):
        class Own(CuriosityES):
            def __init__(self, env="CuriosityMaze-US-v0", **kwargs):
                super().__init__(env, **kwargs)

        assert next(iter(inspect.signature(Own).parameters)) == "env"
        assert "policy" in inspect.signature(Own).parameters

    def test_any_docstring_will_do(self):
        class Typed(CuriosityES):
            """With types.

            Args:
                cell (float): Side of a cell.
                **kwargs: Passed on.

            Raises:
                If it is bad.

            Note:
                Said last.
            """

            def __init__(self, env, *, cell=1.0, **kwargs):
                super().__init__(env, **kwargs)

        text = inspect.getdoc(Typed)
        assert "    cell (float): Side of a cell.\n" in text
        assert "Raises:\n    If it is bad.\n\nNote:\n    Said last.\n\nArgs:" in text
        assert "**kwargs" not in text

    def test_without_a_docstring_it_has_its_parents(self):
        class Silent(NSES):
            pass

        assert inspect.getdoc(Silent) == inspect.getdoc(NSES)

    def test_a_preset_is_applied_or_refused(self, make_easy_maze):
        class Own(CuriosityES):
            def __init__(self, env, **kwargs):
                super().__init__(env, preset="paper", **kwargs)

        with pytest.raises(ValueError, match="`preset` must be given where the model is made"):
            Own(make_easy_maze())
