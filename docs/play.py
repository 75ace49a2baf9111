"""Puts the pages of mazes that play, and of robots, beside the built documentation.

`python docs/play.py FOLDER` makes them alone: `FOLDER/index.html` needs no server. Mazes and
policies are those that come with the packages. `python docs/play.py --search` searches the archives
anew, in some minutes; a processor that rounds differently finds others. `python
docs/play_robots.py` records the robots.
"""

from __future__ import annotations

import base64
import inspect
import json
import re
import shutil
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import torch as th
from stable_baselines3.common.policies import ActorCriticPolicy

import curiosity_gym  # noqa: F401  registers the ids
from curiosity_algos import NSLC
from curiosity_algos.common.arrays import Array
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.experiments.pretrained import PRETRAINED, load_pretrained
from curiosity_gym.locomotion.worlds import GOAL_RADIUS, WORLDS
from curiosity_gym.maze.maze_env import MazeEnv

SOURCE = Path(__file__).parent / "play"
ARCHIVES, EPISODES = SOURCE / "archives.npz", SOURCE / "robots.npz"
FILES = {"DATA": "data.js", "ROBOTS": "robots_data.js"}
SIDE = 10.0
"""Of the squares (maze units) of which an archive has one policy each."""
BUILT_IN = ("US", "Hard", "Snake", "Labyrinth")
FIRST = {"CuriosityES": 0, "PPO": 1}
"""Algorithms that a page lists before others."""
DRAWN = "loops-8x8-seed10"
CONSTANTS = ("max_speed", "max_acceleration", "restitution", "goal_radius", "n_beams")


def data() -> dict[str, Any]:
    """What the page plays: layouts, their constants, and policies and archives by maze."""
    envs: dict[str, Any] = {name: gym.make(f"CuriosityMaze-{name}-v0") for name in BUILT_IN}
    envs["One drawn at random"] = gym.make("CuriosityMaze-v0", layout=DRAWN)
    mazes = {name: described(env.unwrapped.layout) for name, env in envs.items()}
    policies: dict[str, dict[str, Any]] = {name: {} for name in BUILT_IN}
    for algorithm, env_id in sorted(PRETRAINED, key=lambda pair: FIRST.get(pair[0], len(FIRST))):
        name = env_id.split("-")[1]
        if env_id.startswith("CuriosityMaze-"):
            policy = load_pretrained(algorithm, env_id)
            is_robust = isinstance(policy, ActorCriticPolicy)
            said = "trained from many starts" if is_robust else "found by search"
            policies[name][f"{algorithm}, {said}"] = (robust if is_robust else found)(policy)
    env = envs["US"].unwrapped
    keywords = inspect.signature(MazeEnv).parameters
    constants = {name: keywords[name].default for name in CONSTANTS}
    return {
        "mazes": mazes,
        "policies": policies,
        "archives": archives(),
        "constants": constants,
        "horizon": env.horizon,
    }


def found(policy: MlpPolicy) -> dict[str, Any]:
    """A network of ReLU and, at its end, tanh."""
    return {"sizes": policy.mlp.sizes.tolist(), "weights": packed(policy.vector.astype("<f4"))}


def robust(policy: ActorCriticPolicy) -> dict[str, Any]:
    """A network of tanh whose inputs are standardized, without its values."""
    layers = [*policy.mlp_extractor.policy_net, policy.action_net]
    linear = [layer for layer in layers if isinstance(layer, th.nn.Linear)]
    parts = [part.detach().numpy() for layer in linear for part in (layer.weight.T, layer.bias)]
    weights = np.concatenate([part.ravel() for part in parts])
    normalizer = policy.features_extractor.normalizer
    return {
        "sizes": [layer.in_features for layer in linear] + [linear[-1].out_features],
        "weights": packed(weights.astype("<f4")),
        "mean": normalizer.mean.tolist(),
        "scale": normalizer.scale.tolist(),
        "farthest": normalizer.CLIP,
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


def packed(numbers: Array) -> str:
    """Numbers as text: their bytes, of weights in float32."""
    return base64.b64encode(numbers.tobytes()).decode()


def archives() -> dict[str, Any]:
    """Of each built-in maze linear policies, and the squares that their episodes end in."""
    with np.load(ARCHIVES) as saved:
        return {
            name: {
                "sizes": saved["sizes"].tolist(),
                "weights": packed(saved[f"{name}/weights"].astype("<f4")),
                "squares": saved[f"{name}/squares"].tolist(),
                "side": SIDE,
            }
            for name in BUILT_IN
        }


def robots() -> dict[str, Any]:
    """What the page of robots shows, by title: a world, and pictures of episodes in it."""
    shown: dict[str, Any] = {}
    with np.load(EPISODES) as saved:
        for name, array in saved.items():
            title, field = name.split("/")
            value = packed(array) if field == "pictures" else array.tolist()
            shown.setdefault(title, {})[field] = value
    for film in shown.values():
        film["world"] = as_seen_from_start(film["world"])
    return shown


def as_seen_from_start(world: str) -> dict[str, Any]:
    """Walls, goal and bounds of a robot's world (meters)."""
    layout = WORLDS[world]
    x, y = layout.start
    return {
        "walls": [[left - x, low - y, width, height] for left, low, width, height in layout.walls],
        "goal": [layout.goal[0] - x, layout.goal[1] - y],
        "goal_radius": GOAL_RADIUS,
        "low": [-x, -y],
        "high": [layout.width - x, layout.height - y],
    }


def search(timesteps: float = 3e7) -> None:
    """Let NSLC fill an archive for each maze, and keep the best policy of each square."""
    arrays: dict[str, Array] = {}
    for name in BUILT_IN:
        model = NSLC(f"CuriosityMaze-{name}-v0", seed=0, policy_kwargs={"net_arch": []})
        elites = model.learn(timesteps).archive.data()
        order = np.argsort(-elites["objective"], kind="stable")
        squares = (elites["measures"][order, :2] // SIDE).astype(np.int64)
        squares, first = np.unique(squares, axis=0, return_index=True)
        arrays[f"{name}/squares"] = squares
        arrays[f"{name}/weights"] = elites["solution"][order[first]]
    np.savez_compressed(ARCHIVES, sizes=np.array(model.policy.mlp.sizes), **arrays)


def write(folder: Path, *, is_alone: bool = True) -> None:
    """Write the page and its data into a folder; alone, it links to no other page."""
    ignored = shutil.ignore_patterns("*.npz")
    shutil.copytree(SOURCE, folder, dirs_exist_ok=True, ignore=ignored)
    if is_alone:
        for page in folder.glob("*.html"):
            text = re.sub(r'<a href="\.\./.*?</a>', "", page.read_text(), flags=re.DOTALL)
            page.write_text(text)
    for name, values in (("DATA", data()), ("ROBOTS", robots())):
        text = json.dumps(values, separators=(",", ":"))
        (folder / FILES[name]).write_text(f"const {name} = {text};\n")


def setup(app: Any) -> dict[str, Any]:
    """As an extension of Sphinx: write it where the other pages are."""
    app.connect(
        "build-finished",
        lambda app, error: error or write(Path(app.outdir) / "play", is_alone=False),
    )
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    search() if sys.argv[1] == "--search" else write(Path(sys.argv[1]))
