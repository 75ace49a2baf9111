"""Programs in processes of their own: the documentation's, shortened, and those of tests."""

import multiprocessing
import os
import re
import runpy
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def cut_budgets(program):
    """The program with a budget of 1e3 and episodes of 100 steps, as a test is no training run."""
    program = re.sub(r"\b\d+(\.\d+)?e[45678]\b", "1e3", program)
    return re.sub(r"\b(max_episode_steps|horizon)=1000\b", r"\1=100", program)


def run_python(code, **given):
    """What a fresh interpreter prints, to which warnings are errors.

    Args:
        code: The program.
        **given: Further keywords of `subprocess.run`.
    """
    command = [sys.executable, "-W", "error", "-c", code]
    ran = subprocess.run(command, capture_output=True, text=True, timeout=120, **given)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def run_without_display(code, **environment):
    """What a fresh interpreter prints, and what it complains of; forks are no complaint."""
    # From 3.12 on Python warns of every fork of a process that has threads.
    command = [sys.executable, "-W", "ignore:This process:DeprecationWarning", "-c", code]
    kept = {name: value for name, value in os.environ.items() if "DISPLAY" not in name}
    given = {"env": kept | environment, "capture_output": True, "text": True, "timeout": 300}
    ran = subprocess.run(command, check=False, **given)
    return ran.stdout, ran.stderr


def run_script(script, folder, arguments=()):
    """What a script prints in a folder, in a process that has our packages imported already."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["curiosity_algos.experiments", "curiosity_algos.algorithms.nslc"]
    )
    printed = folder / "printed.log"
    process = context.Process(target=_run, args=(script, folder, arguments, printed))
    process.start()
    process.join()
    assert process.exitcode == 0, printed.read_text()
    process.close()
    return printed.read_text()


def _run(script, folder, arguments, printed):
    with printed.open("w") as file:
        for descriptor in (1, 2):
            os.dup2(file.fileno(), descriptor)
    os.chdir(folder)
    sys.argv = [str(script), *arguments]
    sys.path.insert(0, str(script.parent))  # as Python does
    runpy.run_path(str(script), run_name="__main__")
