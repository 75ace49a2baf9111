"""Puts the page that plays mazes in the browser beside the built documentation.

`python docs/play.py FOLDER` makes it alone: `FOLDER/index.html` needs no server. Mazes and policies
are those that come with the packages.
"""

from __future__ import annotations

import inspect
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

import curiosity_gym  # noqa: F401  registers the ids
from curiosity_algos.experiments.pretrained import PRETRAINED, load_pretrained
from curiosity_gym.maze.maze_env import MazeEnv

SOURCE = Path(__file__).parent / "play"
BUILT_IN = ("US", "Hard", "Snake", "Labyrinth")
DRAWN = "loops-8x8-seed10"
CONSTANTS = ("max_speed", "max_acceleration", "restitution", "goal_radius", "n_beams")


def data() -> dict[str, Any]:
    """What the page plays: layouts, their constants, and the weights of policies by maze."""
    envs: dict[str, Any] = {name: gym.make(f"CuriosityMaze-{name}-v0") for name in BUILT_IN}
    envs["One drawn at random"] = gym.make("CuriosityMaze-v0", layout=DRAWN)
    mazes = {name: described(env.unwrapped.layout) for name, env in envs.items()}
    policies: dict[str, dict[str, list[float]]] = {name: {} for name in BUILT_IN}
    for algorithm, env_id in sorted(PRETRAINED, key=lambda pair: pair[0] != "CuriosityES"):
        name = env_id.split("-")[1]
        if env_id.startswith("CuriosityMaze-"):
            policies[name][f"{algorithm}, found by search"] = weights(algorithm, env_id)
    env = envs["US"].unwrapped
    sizes = [env.observation_space.shape[0], 32, 16, env.action_space.shape[0]]
    keywords = inspect.signature(MazeEnv).parameters
    constants = {name: keywords[name].default for name in CONSTANTS}
    return {
        "mazes": mazes,
        "policies": policies,
        "constants": constants,
        "horizon": env.horizon,
        "sizes": sizes,
    }


def described(layout: Any) -> dict[str, Any]:
    """A layout in plain numbers."""
    return {
        "width": layout.width,
        "height": layout.height,
        "start": list(layout.start),
        "goal": list(layout.goal),
        "walls": layout.walls.tolist(),
    }


def weights(algorithm: str, env_id: str) -> list[float]:
    """The parameters of a policy, as few digits as give the same float32."""
    vector = load_pretrained(algorithm, env_id).vector
    return [float(np.format_float_scientific(each, unique=True)) for each in vector]


def write(folder: Path, *, is_alone: bool = True) -> None:
    """Write the page and its data into a folder; alone, it links to no other page."""
    shutil.copytree(SOURCE, folder, dirs_exist_ok=True)
    if is_alone:
        page = folder / "index.html"
        page.write_text(re.sub(r'<a href="\.\./.*?</a>', "", page.read_text(), flags=re.DOTALL))
    text = json.dumps(data(), separators=(",", ":"))
    (folder / "data.js").write_text(f"const DATA = {text};\n")


def setup(app: Any) -> dict[str, Any]:
    """As an extension of Sphinx: write it where the other pages are."""
    app.connect(
        "build-finished",
        lambda app, error: error or write(Path(app.outdir) / "play", is_alone=False),
    )
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    write(Path(sys.argv[1]))
