"""Programs of the documentation, shortened and run as users run them."""

import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def cut_budgets(program):
    """The program with a budget of 1e3 in the place of each, as a test is no training run."""
    return re.sub(r"\b\d+(\.\d+)?e[45678]\b", "1e3", program)


def run_python(arguments, folder):
    """What Python prints with these arguments, in a folder."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "SDL_VIDEODRIVER": "dummy"}
    environment["OMP_NUM_THREADS"] = "1"  # beside other tests, torch's threads only wait
    result = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True
    )
    assert result.returncode == 0, result.stderr
    return result.stdout
