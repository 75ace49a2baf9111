import sys
import tomllib
from pathlib import Path

import pytest

from curiosity_gym.extras import DM_CONTROL, install_command

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("extra", "version", "command"),
    [
        ("robotics", (3, 13), 'pip install "curiosity-search[robotics]"'),
        ("control", (3, 12), 'pip install "curiosity-search[control]"'),
        (
            "control",
            (3, 13),
            'pip install "curiosity-search[control]" && '
            'pip install --no-deps "dm-control>=1.0.50,<2"',
        ),
    ],
)
@pytest.mark.extra
def test_the_command_suits_the_version_of_python(extra, version, command, monkeypatch):
    monkeypatch.setattr(sys, "version_info", version)
    assert install_command(extra) == command


def test_the_command_and_the_extra_have_the_same_bounds():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    requirements = {
        requirement.partition(";")[0] for requirement in project["optional-dependencies"]["control"]
    }
    assert DM_CONTROL in requirements
    page = (ROOT / "docs/environments/control.md").read_text()
    assert f'\npip install --no-deps "{DM_CONTROL}"\n' in page
