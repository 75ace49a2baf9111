"""What each extra installs works: a release of a dependency that breaks shows here at once."""

import importlib
import re
import shutil
import subprocess
import tomllib
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from packaging.requirements import Requirement

import curiosity_gym  # noqa: F401  registers the ids

ROOT = Path(__file__).parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
DISTRIBUTION = PYPROJECT["project"]["name"]
ANOTHER_DISTRIBUTION = re.compile(
    r"""["'`]curiosity\\?\[ | pip3?\ install\b[^\n]*[ \t"'`]curiosity(?![\w-])""", re.VERBOSE
)
"""Text that installs the distribution `curiosity`, which is not ours."""
FOLDERS = ["benchmarks", "curiosity_algos", "curiosity_gym", "docs", "examples", "tests"]
MODULES = {
    "control": ["dm_control.suite", "imageio", "mujoco.batch", "packaging", "shimmy"],
    "locomotion": ["imageio", "mujoco"],
    "robotics": ["gymnasium_robotics", "mujoco"],
    "render": ["pygame"],
    "ray": ["ray"],
    "minari": ["h5py", "minari"],
    "onnx": ["onnx"],
    "tensorboard": ["tensorboard"],
    "track": ["wandb"],
    "video": ["moviepy"],
}
ENVS = {
    "control": ["CuriosityControl-Stacker-v0", "CuriositySparse-CartPoleSwingUp-v0"],
    "locomotion": [
        "CuriosityLocomotion-AntTrap-v0",
        "CuriosityLocomotion-AntMaze-v0",
        "CuriosityLocomotion-HumanoidTrap-v0",
    ],
    "robotics": ["CuriositySparse-PointMaze_UMaze-v0", "CuriositySparse-AntMaze_UMaze-v0"],
    "render": ["CuriosityMaze-Hard-v0"],
}


def texts():
    """Every source and page of the repository but this file."""
    patterns = [f"{folder}/**/*.{kind}" for folder in FOLDERS for kind in ("md", "py")]
    found = {path for pattern in ["*.*", "Makefile", *patterns] for path in ROOT.glob(pattern)}
    return sorted(path for path in found - {Path(__file__)} if path.is_file())


def test_no_file_tells_users_to_install_a_package_of_others():
    found = [
        f"{path.relative_to(ROOT)}: {match[0]}"
        for path in texts()
        for match in ANOTHER_DISTRIBUTION.finditer(path.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.skipif(shutil.which("make") is None, reason="there is no make")
@pytest.mark.parametrize(("target", "extras"), [("demo", ["render"]), ("test", ["render", "dev"])])
def test_a_target_installs_what_it_needs(target, extras):
    make = ["make", "--dry-run", "--always-make", target]
    done = subprocess.run(make, cwd=ROOT, capture_output=True, text=True, check=True)
    assert re.findall(r'-e "\.\[(\w+)\]"', done.stdout) == extras


def test_every_extra_for_users_is_here():
    collections = {"all", "bench", "dev", "docs"}
    assert set(MODULES) == set(PYPROJECT["project"]["optional-dependencies"]) - collections


def test_the_tests_install_every_extra_that_has_an_environment():
    dev = PYPROJECT["project"]["optional-dependencies"]["dev"]
    own = next(entry for entry in dev if entry.startswith(f"{DISTRIBUTION}["))
    assert set(ENVS) <= set(own.removeprefix(f"{DISTRIBUTION}[").removesuffix("]").split(","))


@pytest.mark.parametrize(
    "extra", [pytest.param(extra, marks=pytest.mark.extra(extra)) for extra in MODULES]
)
def test_imports(extra):
    for name in MODULES[extra]:
        assert importlib.import_module(name).__name__ == name


@pytest.mark.parametrize(
    ("extra", "env_id"),
    [
        pytest.param(extra, env_id, marks=pytest.mark.extra(extra))
        for extra, env_ids in ENVS.items()
        for env_id in env_ids
    ],
)
def test_steps_an_environment(extra, env_id):
    env = gym.make(env_id, render_mode="human" if extra == "render" else None)
    first = env.reset(seed=0)[0]
    for _ in range(3):
        observation, reward, *_ = env.step(np.ones(env.action_space.shape, np.float32))
    env.close()
    assert env.observation_space.contains(observation)
    assert reward == 0.0
    assert (observation != first).any()


def lower_bounds():
    """What users install, at its oldest: name, version; on Python 3.11."""
    project = PYPROJECT["project"]
    extras = project["optional-dependencies"]
    for entry in project["dependencies"] + [e for name in MODULES for e in extras[name]]:
        requirement = Requirement(entry)
        if requirement.marker is None or requirement.marker.evaluate({"python_version": "3.11"}):
            yield from (
                (requirement.name, bound.version)
                for bound in requirement.specifier
                if bound.operator == ">="
            )


def test_the_oldest_versions_are_the_lower_bounds():
    lines = (ROOT / "constraints-lowest.txt").read_text().splitlines()
    pins = dict(line.split("==") for line in lines if not line.startswith("#"))
    bounds = dict(lower_bounds())
    assert {name: pins[name] for name in bounds} == bounds
