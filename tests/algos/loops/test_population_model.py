"""Parts that the user passed: `load` asks for them again, whatever has failed before."""

import pytest

from curiosity_algos import CanonicalES
from curiosity_algos.loops import evolutionary_algorithm


def test_an_env_that_could_not_be_set_changes_no_evaluator(
    make_model, make_easy_maze, tmp_path, monkeypatch
):
    own = make_model(CanonicalES, make_easy_maze()).evaluator
    model = make_model(CanonicalES, make_easy_maze(), evaluator=own)

    def fail(*arguments):
        raise ConnectionError

    with monkeypatch.context() as context:
        context.setattr(evolutionary_algorithm, "choose_evaluator", fail)
        with pytest.raises(ConnectionError):
            model.set_env(make_easy_maze(), evaluator="auto")
    assert model.evaluator is own
    model.save(tmp_path / "model")
    with pytest.raises(ValueError, match="`evaluator` must be given to `load`"):
        CanonicalES.load(tmp_path / "model", make_easy_maze())


def test_one_that_was_set_is_remembered(make_model, make_easy_maze, tmp_path):
    own = make_model(CanonicalES, make_easy_maze()).evaluator
    model = make_model(CanonicalES, make_easy_maze(), evaluator=own)
    model.set_env(make_easy_maze(), evaluator="auto")
    model.save(tmp_path / "model")
    assert CanonicalES.load(tmp_path / "model", make_easy_maze()).evaluator is not None
