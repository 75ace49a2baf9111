import sys

import pytest

from curiosity_gym.extras import install_command


@pytest.mark.parametrize(
    ("extra", "version", "command"),
    [
        ("robotics", (3, 13), 'pip install "curiosity-search[robotics]"'),
        ("control", (3, 12), 'pip install "curiosity-search[control]"'),
        (
            "control",
            (3, 13),
            'pip install "curiosity-search[control]" && pip install --no-deps dm-control',
        ),
    ],
)
@pytest.mark.extra
def test_the_command_suits_the_version_of_python(extra, version, command, monkeypatch):
    monkeypatch.setattr(sys, "version_info", version)
    assert install_command(extra) == command
