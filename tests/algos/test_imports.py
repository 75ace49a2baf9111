"""What `import curiosity_algos` brings with it, and that nothing is missing for it."""

import pickle

import pytest
from scripts import run_python

import curiosity_algos
import curiosity_gym

WITH_ARCHIVES = ["AURORA", "CMAME", "CuriosityMAPElites", "MAPElites", "NSLC"]
HEAVY = ["ribs", "sklearn", "pandas", "matplotlib", "numpy_groupies", "scipy.stats"]


def test_without_archives_no_pyribs():
    code = f"""
import io, sys
import stable_baselines3
before = set(sys.modules)
import curiosity_algos
dir(curiosity_algos), hasattr(curiosity_algos, "nothing")
from curiosity_algos import CuriosityES, ICMVecEnvWrapper, NSES, TD3ICM, make_evaluator
print([name for name in {HEAVY} if name in sys.modules.keys() - before])
model = NSES("CuriosityMaze-Hard-v0", population_size=4, seed=0).learn(1)
file = io.BytesIO()
model.save(file)
file.seek(0)
NSES.load(file)
import curiosity_algos.cli, curiosity_algos.experiments
print("ribs" in sys.modules)
"""
    assert run_python(code).splitlines() == ["[]", "False"]


def test_the_command_completes_words_and_lists_names_without_what_is_slow_to_import():
    code = """
import os, sys
import curiosity_algos
from curiosity_algos.cli import main
sys.argv = ["curiosity", *sys.argv[1:]]
asked = "train --algo map_", "train --algo a2", "sweep --envs CuriosityMaze-U"
for asked in (*asked, "train --bonus rnd,nov"):
    os.environ |= {"_CURIOSITY_COMPLETE": "complete_bash", "COMP_WORDS": f"curiosity {asked}"}
    os.environ["COMP_CWORD"] = "3"
    try:
        main()
    except SystemExit:
        pass
del os.environ["_CURIOSITY_COMPLETE"]
for asked in ("--help", "--version", "list"):
    sys.argv[1:] = [asked]
    try:
        main()
    except SystemExit:
        pass
slow = ("torch", "stable_baselines3", "pandas", "matplotlib", "ribs", "sklearn")
print([name for name in slow if name in sys.modules])
"""
    *printed, imported = run_python(code).splitlines()
    completed = [word for word in printed if word][:4]
    assert completed == ["map_elites", "a2c", "CuriosityMaze-US-v0", "rnd,noveld"]
    assert {"Environments:", curiosity_gym.__version__} < set(printed)
    assert imported == "[]"


def test_they_come_when_they_are_asked_for():
    """A pickle asks for its class where nothing is imported, then the others are by their names."""
    pickled = pickle.dumps(curiosity_algos.MAPElites)
    code = f"""
import pickle
print(pickle.loads({pickled!r}).__name__)
from curiosity_algos import {", ".join(WITH_ARCHIVES)}
print(*[each.__name__ for each in ({", ".join(WITH_ARCHIVES)})])
all_of_them = {{}}
exec("from curiosity_algos import *", all_of_them)
print(*all_of_them)
"""
    loaded, by_name, public = map(str.split, run_python(code).splitlines())
    assert loaded == ["MAPElites"]
    assert by_name == WITH_ARCHIVES
    assert set(curiosity_algos.__all__) <= set(public)


def test_every_public_name_is_there():
    assert set(curiosity_algos.__all__) <= set(dir(curiosity_algos))
    for name in curiosity_algos.__all__:
        assert callable(getattr(curiosity_algos, name))


def test_other_names_are_missing():
    with pytest.raises(AttributeError, match="module 'curiosity_algos' has no attribute 'Nothing'"):
        curiosity_algos.Nothing  # noqa: B018
    with pytest.raises(ImportError, match="cannot import name 'Nothing'"):
        from curiosity_algos import Nothing  # noqa: F401
