import inspect
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
import yaml

import curiosity_algos
from curiosity_algos import TD3ICM, load_preset
from curiosity_algos.common.names import ALGORITHMS
from curiosity_algos.common.presets import PRESETS

FOLDER = Path(curiosity_algos.__file__).parent / "presets"
NO_SETTINGS = {"env", "policy", "evaluator", "archive", "action_noise"}
"""Arguments that a model keeps in another form."""
HARD = "CuriosityMaze-Hard-v0"
MAZES = ["CuriosityMaze-Snake-v0", "CuriosityMaze-US-v0", HARD]
NAMES = {"paper": sorted(set(ALGORITHMS) - {"GoExplore"}), "tuned": ALGORITHMS}
CONTROL = [f"CuriosityControl-{name}-v0" for name in ("BallInCup", "Finger", "Stacker")]


@pytest.mark.extra("control")
@pytest.mark.parametrize(("preset", "algorithm"), [(p, a) for p in PRESETS for a in NAMES[p]])
def test_every_preset_makes_models(preset, algorithm):
    make = getattr(curiosity_algos, algorithm)
    made = {}
    for env_id in MAZES + CONTROL:
        keywords = load_preset(preset, algorithm, env_id)
        if keywords in made.values():
            continue  # as of another environment
        made[env_id] = keywords
        model, default = make.from_preset(preset, env_id), make(env_id)
        for name in inspect.signature(make).parameters.keys() & vars(model).keys() - NO_SETTINGS:
            assert getattr(model, name) == keywords.get(name, getattr(default, name))


@pytest.mark.parametrize("preset", PRESETS)
def test_every_algorithm_and_task_has_settings(preset):
    table = yaml.safe_load((FOLDER / f"{preset}.yml").read_text())
    assert sorted(table) == sorted(NAMES[preset])
    aliases = {env_id.removeprefix("Curiosity") for env_id in MAZES}
    for algorithm, settings in table.items():
        assert settings.keys() == {*MAZES, *aliases, *CONTROL}
        taken = inspect.signature(getattr(curiosity_algos, algorithm)).parameters.keys()
        assert all(keywords.keys() <= taken for keywords in settings.values())


def test_the_papers_td3_is_the_class_but_for_its_inputs():
    own = {"bonus": "icm", "bonus_kwargs": {"normalize": False}}
    assert load_preset("paper", "TD3ICM", HARD) == own
    kwargs = {"normalize": False, "learning_rate": 6e-6}
    assert TD3ICM.from_preset("paper", HARD).replay_buffer_kwargs["bonus_kwargs"] == kwargs


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


def test_an_algorithm_without_settings_is_refused():
    with pytest.raises(ValueError, match="not of CuriosityEs"):
        load_preset("tuned", "CuriosityEs", HARD)
