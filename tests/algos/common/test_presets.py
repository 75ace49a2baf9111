import inspect
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import gymnasium as gym
import pytest
import yaml
from stable_baselines3.common.vec_env import DummyVecEnv

import curiosity_algos
from curiosity_algos import NSES, TD3ICM, CuriosityES, load_preset
from curiosity_algos.common import presets
from curiosity_algos.common.presets import PRESETS
from curiosity_algos.experiments.names import ALGORITHMS

FOLDER = Path(curiosity_algos.__file__).parent / "presets"
NO_SETTINGS = {"env", "policy", "preset", "evaluator", "archive", "action_noise"}
"""Arguments that a model keeps in another form."""
HARD = "CuriosityMaze-Hard-v0"
MAZES = ["CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", HARD]
CONTROL = [f"CuriosityControl-{name}-v0" for name in ("BallInCup", "Finger", "Stacker")]


def known(preset):
    """Algorithm and environment of every entry of a preset, but for aliases."""
    table = yaml.safe_load((FOLDER / f"{preset}.yml").read_text())
    return [
        (preset, algorithm, env_id)
        for algorithm, settings in table.items()
        for env_id in settings
        if env_id.startswith("Curiosity")
    ]


@pytest.mark.parametrize(
    ("preset", "algorithm", "env_id"), [entry for preset in PRESETS for entry in known(preset)]
)
def test_every_preset_makes_a_model(preset, algorithm, env_id):
    keywords = load_preset(preset, algorithm, env_id)
    make = getattr(curiosity_algos, algorithm)
    asked, spelled_out, default = (
        make(env_id, **each) for each in ({"preset": preset}, keywords, {})
    )
    assert asked.preset == preset
    for name in inspect.signature(make).parameters.keys() & vars(asked).keys() - NO_SETTINGS:
        expected = keywords.get(name, getattr(default, name))
        assert getattr(asked, name) == getattr(spelled_out, name) == expected


@pytest.mark.parametrize("preset", PRESETS)
def test_every_algorithm_and_task_has_settings(preset):
    table = yaml.safe_load((FOLDER / f"{preset}.yml").read_text())
    assert sorted(table) == sorted(ALGORITHMS)
    aliases = {env_id.removeprefix("Curiosity") for env_id in MAZES}
    for algorithm, settings in table.items():
        assert settings.keys() == {*MAZES, *aliases, *CONTROL}
        taken = inspect.signature(getattr(curiosity_algos, algorithm)).parameters.keys()
        assert all(keywords.keys() <= taken for keywords in settings.values())


class TestFile:
    @pytest.fixture
    def write(self, tmp_path, monkeypatch):
        path = tmp_path / "paper.yml"
        monkeypatch.setitem(presets._FILES, "paper.yml", path)
        return path.write_text

    @pytest.mark.parametrize(
        "text", ["CuriosityMaze-Hrd-v0: {}", f"{HARD}:", f"{HARD}: 3", f"{HARD}: [sigma]"]
    )
    def test_environments_must_be_known(self, write, text):
        write(f"NSES: {{{HARD}: {{}}}}\nCuriosityES:\n  {text}")
        with pytest.raises(ValueError, match="of CuriosityES it has Curiosity"):
            load_preset("paper", "NSES", HARD)

    def test_keywords_must_be_known(self, write):
        write(f"NSES: {{{HARD}: {{k: 3, sigm: 1}}}}")
        with pytest.raises(ValueError, match="must have keywords of NSES, it has sigm"):
            NSES(HARD, preset="paper")


def test_the_papers_td3_is_the_class_but_for_its_inputs():
    model = TD3ICM(HARD, preset="paper")
    settings = {"learning_rate": 5e-5, "gamma": 0.99, "batch_size": 128, "tau": 0.005}
    settings |= {"learning_starts": 10_000, "buffer_size": 1_000_000, "n_updates": 64}
    assert {name: getattr(model, name) for name in settings} == settings
    assert model.bonus_kwargs == {"normalize": False}


def test_a_loaded_td3_has_its_preset(tmp_path):
    TD3ICM(HARD, preset="paper", buffer_size=10).save(tmp_path / "model")
    assert TD3ICM.load(tmp_path / "model").preset == "paper"
    with pytest.raises(ValueError, match="`preset` must be as saved, paper"):
        TD3ICM.load(tmp_path / "model", preset="tuned")


@pytest.mark.parametrize("preset", PRESETS)
@pytest.mark.parametrize("env_id", MAZES)
@pytest.mark.parametrize("algorithm", ["CuriosityES", "NSES", "MAPElites"])
def test_aliases_have_the_same_settings(preset, env_id, algorithm):
    alias = env_id.removeprefix("Curiosity")
    assert load_preset(preset, algorithm, alias) == load_preset(preset, algorithm, env_id)


def test_the_papers_table():
    snake, hard = (load_preset("paper", "CuriosityES", env_id) for env_id in (MAZES[0], HARD))
    assert (snake["learning_rate"], snake["bonus_kwargs"]["beta"]) == (0.5, 0.1)
    assert (hard["learning_rate"], hard["bonus_kwargs"]["beta"]) == (1.0, 0.2)
    assert {each["sigma"] for each in (snake, hard)} == {0.5}
    control = [load_preset("paper", "CuriosityES", env_id) for env_id in CONTROL]
    assert [each["sigma"] for each in control] == [0.005, 0.005, 0.001]
    assert [each["learning_rate"] for each in control] == [1.0, 0.5, 0.5]
    assert [each["n_updates"] for each in control] == [96, 96, 64]
    assert {each["gamma"] for each in control} == {0.999}
    assert {each["bonus_kwargs"]["beta"] for each in control} == {0.2}


def test_the_papers_neighbors_and_mutations():
    neighbors = [load_preset("paper", "NSES", env_id)["k"] for env_id in MAZES + CONTROL]
    assert neighbors == [20, 10, 20, 20, 10, 20]
    for algorithm in ("NSES", "MAPElites", "CMAME", "NSLC", "AURORA", "CuriosityMAPElites"):
        sigmas = [load_preset("paper", algorithm, env_id)["sigma"] for env_id in MAZES + CONTROL]
        assert sigmas == [0.5, 0.5, 0.5, 0.005, 0.005, 0.001]


def test_presets_are_found_in_an_archive(tmp_path):
    archive, root = tmp_path / "packages.zip", FOLDER.parents[1]
    with zipfile.ZipFile(archive, "w") as file:
        for package in ("curiosity_gym", "curiosity_algos"):
            for source in (root / package).rglob("*"):
                if source.suffix in (".py", ".yml"):
                    file.write(source, source.relative_to(root))
    code = (
        "from curiosity_algos.common import presets as it\n"
        f"print(it.__file__, *it.PRESETS, *it.load_preset('paper', 'CuriosityES', '{HARD}'))"
    )
    environment = {**os.environ, "PYTHONPATH": str(archive), "HOME": str(tmp_path)}
    command = [sys.executable, "-c", code]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, cwd="/")
    expected = [f"{archive}/curiosity_algos/common/presets.py", *PRESETS]
    expected += load_preset("paper", "CuriosityES", HARD)
    assert result.stdout.split() == expected, result.stderr


def test_an_unknown_preset_is_refused():
    with pytest.raises(ValueError, match="`preset` must be one of paper, tuned"):
        load_preset("best", "CuriosityES", HARD)


def test_what_a_preset_says_nothing_of_is_refused():
    with pytest.raises(ValueError, match="not of CuriosityEs"):
        load_preset("tuned", "CuriosityEs", HARD)
    with pytest.raises(ValueError, match="not for Pendulum-v1"):
        CuriosityES("Pendulum-v1", preset="paper")
    with pytest.raises(ValueError, match="not for CuriosityMaze-Labyrinth-v0"):
        TD3ICM("CuriosityMaze-Labyrinth-v0", preset="paper")


def test_a_preset_is_found_for_every_kind_of_env():
    expected = load_preset("paper", "CuriosityES", HARD)["sigma"]
    envs = [
        HARD,
        f"curiosity_gym:{HARD}",
        gym.make("Maze-Hard-v0"),
        gym.make_vec(HARD, num_envs=2),
        DummyVecEnv([lambda: gym.make(HARD)]),
    ]
    sigmas = [CuriosityES(env, preset="paper").sigma for env in envs]
    assert sigmas == [expected] * len(envs)
    assert CuriosityES(env=HARD, preset="paper").sigma == expected != CuriosityES(HARD).sigma


def test_what_is_given_counts_more_than_the_preset():
    model = CuriosityES(HARD, preset="paper", sigma=0.3)  # its default, said aloud
    assert (model.sigma, model.learning_rate, model.step) == (0.3, 1.0, "paper")


def test_defaults_do_not_depend_on_environment_and_class():
    class Renamed(NSES):
        pass

    gym.register("SameMaze-v0", gym.spec(HARD).entry_point, kwargs=gym.spec(HARD).kwargs)
    models = [NSES("Pendulum-v1", behavior="state"), NSES(HARD), Renamed(HARD), NSES("SameMaze-v0")]
    assert {model.learning_rate for model in models} == {2.0}
    assert Renamed(HARD, preset="paper").sigma == NSES(HARD, preset="paper").sigma == 0.5


def test_keywords_of_a_bonus_are_merged_or_those_of_another_bonus():
    given = CuriosityES(HARD, preset="paper", bonus_kwargs={"learning_rate": 1e-5})
    assert given.bonus_kwargs == {"learning_rate": 1e-5, "beta": 0.2, "normalize": False}
    assert CuriosityES(HARD, preset="paper", bonus="rnd").bonus_kwargs == {}
