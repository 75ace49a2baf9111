import io
import json
import warnings
import zipfile
from inspect import signature

import gymnasium as gym
import numpy as np
import pytest
from saved_files import no_space, rewrite
from stable_baselines3 import PPO
from stable_baselines3.common.base_class import BaseAlgorithm

from curiosity_algos import ICM, NSES, CanonicalES, CuriosityES
from curiosity_algos.checkpoints import model_file as checkpoint
from curiosity_algos.checkpoints.model_file import check_is_checkpoint, checkpoint_path
from tests.algos.conftest import SETTINGS


@pytest.fixture(name="algorithm")
def one_algorithm():
    return CuriosityES


def test_names_get_stable_baselines_suffix(tmp_path):
    assert checkpoint_path("model").name == "model.zip"
    assert checkpoint_path(tmp_path / "model.best") == tmp_path / "model.best"


def test_a_full_disk_leaves_the_old_checkpoint(make_model, make_maze, tmp_path, monkeypatch):
    model, path = make_model(CanonicalES, make_maze()).learn(1), tmp_path / "model.zip"
    model.save(path)
    before = path.read_bytes()

    def write_half(file, **kwargs):
        file.write(b"half of a checkpoint")
        no_space()

    monkeypatch.setattr(checkpoint, "save_to_zip_file", write_half)
    with pytest.raises(OSError, match="No space left"):
        model.learn(1).save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


class TestWhatCouldNotBeRead:
    def test_the_old_file_survives(self, algorithm, make_model, make_maze, tmp_path):
        env = make_maze()
        bonus = ICM(env.observation_space, env.action_space, device="cpu")
        model, path = make_model(algorithm, env, bonus=bonus), tmp_path / "model.zip"
        model.save(path)
        before, bonus.state_dict = path.read_bytes(), lambda: {"counts": np.zeros(3)}
        with pytest.raises(ValueError, match="`bonus` must have a state of tensors and plain"):
            model.save(path)
        assert path.read_bytes() == before
        assert list(tmp_path.iterdir()) == [path]

    def test_the_part_is_named(self, algorithm, make_model, make_maze, tmp_path, monkeypatch):
        class Counts:
            def state_dict(self):
                return {"table": {"seed": np.zeros(3)}}

        model = make_model(algorithm, make_maze())
        model._counts = Counts()
        names, variables = model._get_torch_save_params()
        found = [*names, "_counts"], variables
        monkeypatch.setattr(algorithm, "_get_torch_save_params", lambda self: found)
        with pytest.raises(ValueError, match="`counts` must have a state of tensors and plain"):
            model.save(tmp_path / "model")


class TestWrongFiles:
    def test_a_missing_one(self, algorithm, tmp_path):
        with pytest.raises(FileNotFoundError, match=r"there is no file .*nothing\.zip"):
            algorithm.load(tmp_path / "nothing")

    def test_a_truncated_one(self, algorithm, make_model, make_maze, tmp_path):
        path = tmp_path / "model.zip"
        make_model(algorithm, make_maze()).save(path)
        content = path.read_bytes()
        for share in (0.0, 0.3, 0.999):
            path.write_bytes(content[: int(share * len(content))])
            with pytest.raises(ValueError, match=r"`path` must be a saved .* is not a whole file"):
                algorithm.load(path)

    def test_one_that_unpacks_to_more_than_it_is(self, algorithm, make_model, make_maze, tmp_path):
        path = tmp_path / "model.zip"
        make_model(algorithm, make_maze()).save(path)
        rewrite(path, lambda members: members, zipfile.ZIP_DEFLATED)
        with pytest.raises(ValueError, match=r"`path` must be a saved .* is not a whole file"):
            algorithm.load(path)

    def test_a_damaged_one(self, algorithm, make_model, make_maze, tmp_path):
        path = tmp_path / "model.zip"
        make_model(algorithm, make_maze()).save(path)
        content = bytearray(path.read_bytes())
        with zipfile.ZipFile(path) as file:
            stored = file.read("data")
        assert stored in content  # as it is, but for its sum
        content[content.index(stored) + len(stored) // 2] ^= 0xFF
        path.write_bytes(content)
        with pytest.raises(ValueError, match="is not a whole file"):
            algorithm.load(path)

    def test_a_foreign_one(self, algorithm, tmp_path):
        text, archive, folder = tmp_path / "a.zip", tmp_path / "b.zip", tmp_path / "c.zip"
        text.write_text("no archive at all")
        with zipfile.ZipFile(archive, "w") as file:
            file.writestr("data", json.dumps([1, 2]))
        folder.mkdir()
        with pytest.raises(ValueError, match="is not a whole file"):
            algorithm.load(text)
        with pytest.raises(ValueError, match="is not a whole file"):
            algorithm.load(archive)
        with pytest.raises(FileNotFoundError):
            algorithm.load(folder)

    def test_a_model_of_stable_baselines(self, algorithm, tmp_path):
        PPO("MlpPolicy", "CartPole-v1", n_steps=8, batch_size=8).save(tmp_path / "ppo")
        with pytest.raises(ValueError, match="is not a whole file of this package"):
            algorithm.load(tmp_path / "ppo")

    def test_a_model_of_another_algorithm(self, make_model, make_maze, tmp_path):
        make_model(CanonicalES, make_maze()).save(tmp_path / "model")
        with pytest.raises(
            ValueError, match=r"must be a saved CuriosityES, .* is one of Canonical"
        ):
            CuriosityES.load(tmp_path / "model")
        check_is_checkpoint(tmp_path / "model", "CanonicalES")


class Strict:
    """A part that takes no state."""

    def state_dict(self):
        return {"n": 1}

    def load_state_dict(self, state, strict=True):
        raise ValueError("`n` must be 2.")


class WithPart(CanonicalES):
    """Has a part that the file has none of, or does not take."""

    part = None

    def _make_search(self, seed):
        super()._make_search(seed)
        if self.part is not None:
            self._part = self.part


class TestStatesThatDoNotFit:
    """They get one sentence, and not the KeyError of what SB3 tries for old models of its own."""

    def test_a_missing_one(self, algorithm, make_model, make_maze, tmp_path):
        path, part = tmp_path / "model.zip", "_episodes"
        make_model(algorithm, make_maze()).save(path)
        rewrite(path, lambda members: {k: v for k, v in members.items() if k != f"{part}.pth"})
        name = algorithm.__name__
        with pytest.raises(
            ValueError, match=rf"^`path` must be a saved {name}: .* missing: `{part}`"
        ):
            algorithm.load(path)

    def test_an_unknown_one(self, algorithm, make_model, make_maze, tmp_path):
        path = tmp_path / "model.zip"
        make_model(algorithm, make_maze()).save(path)
        rewrite(path, lambda members: members | {"seed.pth": members["policy.pth"]})
        with pytest.raises(ValueError, match=r"^`path` must be a saved .* unknown: `seed`\.$"):
            algorithm.load(path)

    def test_a_part_that_the_class_has_gained(self, make_maze, tmp_path, monkeypatch):
        WithPart(make_maze(), population_size=4).save(tmp_path / "model")
        monkeypatch.setattr(WithPart, "part", Strict())
        with pytest.raises(ValueError, match=r"must be a saved WithPart: .* missing: `_part`"):
            WithPart.load(tmp_path / "model")

    def test_a_state_that_a_part_refuses(self, make_maze, tmp_path, monkeypatch):
        monkeypatch.setattr(WithPart, "part", Strict())
        WithPart(make_maze(), population_size=4).save(tmp_path / "model")
        with pytest.raises(ValueError, match=r"^`path` must be a saved WithPart: `n` must be 2"):
            WithPart.load(tmp_path / "model")

    def test_a_setting_that_the_states_were_not_made_with(self, make_maze, tmp_path):
        model = NSES(make_maze(), population_size=4).learn(1)
        model.save(tmp_path / "model")
        others = {"behavior": "state", "policy_kwargs": {"net_arch": [4]}}
        for name, value in others.items():
            with pytest.raises(
                ValueError, match=rf"^`{name}` must be left as it was saved, .*NSES"
            ):
                NSES.load(tmp_path / "model", env=make_maze(), **{name: value})
        same = {"behavior": "final", "policy_kwargs": model.policy_kwargs}
        assert NSES.load(tmp_path / "model", env=make_maze(), **same).generation == 1


class TestSaveAndLoad:
    def test_arguments_are_spelled_out(self, algorithm):
        shown = list(signature(algorithm.load).parameters.values())
        expected = list(signature(BaseAlgorithm.load).parameters)
        assert [each.name for each in shown[: len(expected) - 1]] == expected[:-1]
        assert not any(each.kind is each.VAR_POSITIONAL for each in shown)
        assert "allow_pickle" in {each.name for each in shown if each.kind is each.KEYWORD_ONLY}

    @pytest.mark.parametrize("each_algorithm", SETTINGS)
    def test_everything_comes_back(
        self, each_algorithm, make_model, make_easy_maze, tmp_path, assert_same_run
    ):
        model = make_model(each_algorithm, make_easy_maze()).learn(1000)
        model.save(tmp_path / "model")
        loaded = each_algorithm.load(tmp_path / "model")
        assert_same_run(model, loaded)
        observation, _ = make_easy_maze().reset()
        assert (loaded.predict(observation)[0] == model.predict(observation)[0]).all()
        others = {"n_envs", "start_time"}
        for name, value in vars(model).items():
            if isinstance(value, int | float | str | None) and name not in others:
                assert getattr(loaded, name) == value

    def test_no_name_of_an_attribute_is_taken(self, algorithm, make_model, make_maze, tmp_path):
        model = make_model(algorithm, make_maze())
        model.algorithm = "mine"
        names = set(vars(model))
        model.save(tmp_path / "model")
        loaded = algorithm.load(tmp_path / "model", env=make_maze())
        assert loaded.algorithm == "mine"
        assert set(vars(loaded)) <= names

    def test_a_file_in_memory_will_do(self, algorithm, make_model, make_maze, assert_same_run):
        model, file = make_model(algorithm, make_maze()).learn(1), io.BytesIO()
        model.save(file)
        file.seek(0)
        assert_same_run(model, algorithm.load(file))

    def test_a_loaded_model_needs_an_env_to_learn(self, algorithm, make_model, make_maze, tmp_path):
        make_model(algorithm, make_maze()).learn(1).save(tmp_path / "model")
        loaded = algorithm.load(tmp_path / "model")
        with pytest.raises(ValueError, match="`env` must be set"):
            loaded.learn(1)
        loaded.set_env(make_maze())
        before = loaded.num_timesteps
        assert loaded.learn(1, reset_num_timesteps=False).num_timesteps == 2 * before > 0

    def test_the_env_may_be_an_id(self, algorithm, make_model, make_maze, tmp_path):
        make_model(algorithm, make_maze()).save(tmp_path / "model")
        assert algorithm.load(tmp_path / "model", env="CuriosityMaze-Hard-v0").env is not None

    def test_coverage_starts_anew_in_another_maze(self, algorithm, make_model, make_maze, tmp_path):
        model = make_model(algorithm, make_maze()).learn(1)
        model.save(tmp_path / "model")
        assert algorithm.load(tmp_path / "model", env=make_maze()).coverage == model.coverage > 0
        other = make_maze(layout="snake")
        loaded = algorithm.load(tmp_path / "model", env=other)
        assert loaded.coverage == 0.0
        assert loaded._coverage_grid == other.unwrapped.coverage_grid

    def test_settings_may_change(self, algorithm, make_model, make_maze, tmp_path):
        name = "n_threads"
        make_model(algorithm, make_maze(), **{name: 2}).save(tmp_path / "model")
        loaded = algorithm.load(tmp_path / "model", env=make_maze(), **{name: 1})
        assert getattr(loaded, name) == 1
        with pytest.raises(ValueError, match=f"`{name}` must be"):
            algorithm.load(tmp_path / "model", env=make_maze(), **{name: 0})

    def test_learning_rates_are_kept_from_rl_zoo3(self, make_model, make_maze, tmp_path):
        model = make_model(CuriosityES, make_maze(), learning_rate=0.5)
        model.save(tmp_path / "model")
        custom = {"learning_rate": 0.0, "lr_schedule": lambda _: 0.0, "clip_range": lambda _: 0.0}
        loaded = CuriosityES.load(tmp_path / "model", env=make_maze(), custom_objects=custom)
        assert loaded.learning_rate == 0.5

    def test_other_spaces_are_refused(self, algorithm, make_model, make_maze, tmp_path):
        make_model(algorithm, make_maze()).save(tmp_path / "model")
        with pytest.raises(ValueError, match=r"spaces do not match|Box of actions"):
            algorithm.load(tmp_path / "model", env=gym.make("CartPole-v1"))

    def test_the_buffer_may_stay_out(self, make_model, make_maze, tmp_path):
        model = make_model(CuriosityES, make_maze(), buffer_size=10_000, n_transitions=500)
        model.learn(1)
        model.save(tmp_path / "whole")
        model.save(tmp_path / "light", exclude=["buffer"])
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
