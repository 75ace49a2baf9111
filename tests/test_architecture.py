"""Which module may import which: the arrows of the design, held by parsing the sources."""

import ast
import subprocess
import sys
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parent.parent
PACKAGES = ("curiosity_gym", "curiosity_algos")

FLOORS = [
    ["common"],
    ["state"],
    ["evaluation"],
    ["bonuses"],
    ["curiosity"],
    ["archives", "motivations", "sb3", "search"],
    ["loops"],
    ["algorithms"],
    ["robust"],
    ["experiments"],
    ["cli"],
]
"""Folders of the algorithms from the ground up: each imports those of lower floors alone."""
GYM_FLOORS = [["control", "locomotion", "maze"], ["wrappers"]]
"""Folders of the environments, likewise; what lies beside them is below all of them."""


def above(package, floors):
    """Each folder, and those on its floor and on higher ones, which it must not use."""
    return {
        f"{package}.{name}": [
            f"{package}.{other}" for higher in floors[i:] for other in higher if other != name
        ]
        for i, names in enumerate(floors)
        for name in names
    }


FORBIDDEN = {
    "curiosity_gym": ["curiosity_algos", "stable_baselines3", "torch"],
    **above("curiosity_gym", GYM_FLOORS),
    **above("curiosity_algos", FLOORS),
}
"""Package: what no module of it imports."""


def modules():
    """Every module of the packages: name, source file."""
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts), path


def imports(path):
    """Full names that a source file imports, anywhere in it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path} imports relatively"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def is_within(name, package):
    return f"{name}.".startswith(f"{package}.")


def test_no_module_imports_what_is_above_it():
    wrong = [
        (module, name)
        for module, path in modules()
        for name in imports(path)
        for package, forbidden in FORBIDDEN.items()
        if is_within(module, package) and any(is_within(name, each) for each in forbidden)
    ]
    assert not wrong


def test_every_folder_has_a_rule():
    folders = [path.parent for each in PACKAGES for path in (ROOT / each).glob("*/__init__.py")]
    assert {f"{folder.parent.name}.{folder.name}" for folder in folders} <= set(FORBIDDEN)


def test_rooms_do_not_import_each_other_in_a_circle():
    """Rooms are the folders of a package, and the files beside them."""
    graph = {}
    for module, path in modules():
        if module not in PACKAGES:
            rooms = {".".join(name.split(".")[:2]) for name in imports(path) if is_ours(name)}
            room = ".".join(module.split(".")[:2])
            graph.setdefault(room, set()).update(rooms - {room})
    order = list(TopologicalSorter(graph).static_order())
    assert order.index("curiosity_algos.common") < order.index("curiosity_algos.algorithms")


def is_ours(name):
    return any(is_within(name, package) for package in PACKAGES)


def test_modules_do_not_import_each_other_in_a_circle():
    names = {module for module, _ in modules()}
    graph = {
        module: {_module_of(name, names) for name in imports(path)} - {None}
        for module, path in modules()
        if path.name != "__init__.py"
    }
    assert len(list(TopologicalSorter(graph).static_order())) >= len(graph)


def _module_of(name, names):
    """The module that defines an imported name; a package's own namespace is left out."""
    module = name if name in names else name.rpartition(".")[0]
    return module if module in names and not (ROOT / Path(*module.split("."))).is_dir() else None


def test_importing_the_algorithms_needs_no_extra_and_no_module_new_gymnasium():
    """Spaces can be subscripted since Gymnasium 1.4 only: type checkers alone may do it."""
    extras = ["pygame", "mujoco", "dm_control", "ray", "gymnasium_robotics", "jax"]
    extras += ["h5py", "minari", "onnx", "onnxruntime"]
    code = (
        "import importlib, sys, stable_baselines3\n"
        "from gymnasium import spaces\n"
        "def refuse(cls, item):\n"
        "    raise TypeError(f'{cls.__name__}[{item}]')\n"
        "for space in (spaces.Box, spaces.Dict, spaces.Discrete, spaces.Tuple):\n"
        "    space.__class_getitem__ = classmethod(refuse)\n"
        "from curiosity_algos import *\n"
        f"print([name for name in {extras} if name in sys.modules], flush=True)\n"
        f"for module in {[name for name, _ in modules()]}:\n"
        "    importlib.import_module(module)\n"
    )
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True)
    assert ran.stdout.splitlines()[:1] == ["[]"], ran.stderr
    assert ran.returncode == 0, ran.stderr


def test_no_file_is_longer_than_a_sitting():
    lengths = {name: len(path.read_text(encoding="utf-8").splitlines()) for name, path in modules()}
    assert {name: n for name, n in lengths.items() if n > 450} == {}
