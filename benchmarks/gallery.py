"""`python -m benchmarks.gallery` films each environment for the pages, and says what it has filmed.

In mazes and control tasks the policy is what CuriosityES has come to with its first reward, or with
its budget, "best_ant" and "best_humanoid" are those that come with the package; at the traps it is
the plan that the tests replay, which was found by sampling. All other environments, which nothing
here was trained in, are shown with actions at random. Run it with MUJOCO_GL=egl where there is no
display.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import typer
from PIL import Image

from benchmarks.figures import IMAGES
from benchmarks.until_found import UntilFound
from curiosity_algos import CuriosityES, make_evaluator
from curiosity_algos.evaluation.base import Evaluator
from curiosity_algos.evaluation.policies import MlpPolicy
from curiosity_algos.experiments.film import write_film
from curiosity_algos.experiments.pretrained import load_pretrained, pretrained_seed


class Search(NamedTuple):
    """A run of CuriosityES: its environment, and its timesteps at most."""

    env_id: str
    timesteps: float


FOUND = {
    "snake": Search("CuriosityMaze-Snake-v0", 3e7),
    "us": Search("CuriosityMaze-US-v0", 3e7),
    "hard": Search("CuriosityMaze-Hard-v0", 3e7),
    "labyrinth": Search("CuriosityMaze-Labyrinth-v0", 1e8),
    "ball_in_cup": Search("CuriosityControl-BallInCup-v0", 1e6),
    "finger": Search("CuriosityControl-Finger-v0", 1e6),
    "stacker": Search("CuriosityControl-Stacker-v0", 1e6),
}
"""Name of the picture: what found the episode."""
PRETRAINED = {
    "best_ant": ("CuriosityES", "CuriosityLocomotion-AntTrap-v0"),
    "best_humanoid": ("CuriosityES", "CuriosityLocomotion-HumanoidTrap-v0"),
}
"""Name of the picture: algorithm and environment of a policy that comes with the package."""
PLANNED = {
    "ant_trap": "CuriosityLocomotion-AntTrap-v0",
    "ant_maze": "CuriosityLocomotion-AntMaze-v0",
    "humanoid_trap": "CuriosityLocomotion-HumanoidTrap-v0",
}
RANDOM = {
    **{
        f"robot_{name.lower()}": f"CuriosityLocomotion-{name}-v0"
        for name in ("Ant", "HalfCheetah", "Hopper", "Humanoid", "Swimmer", "Walker2d")
    },
    **{
        f"sparse_{name.lower()}": f"CuriositySparse-{name}-v0"
        for name in (
            "PointMaze_UMaze",
            "PointMaze_Large",
            "AntMaze_UMaze",
            "CartPoleSwingUp",
            "AcrobotSwingUp",
        )
    },
}
N_STEPS, N_HELD = 200, 10
PLANS = Path(__file__).parents[1] / "tests" / "gym" / "locomotion" / "solutions.npz"
N_FRAMES, HEIGHT, N_COLORS = 40, 160, 32
Frame = npt.NDArray[np.uint8]


def find_actions(search: Search) -> tuple[npt.NDArray[Any], int]:
    """Actions of the best episode of a run's best policy, and the seed of its reset."""
    model = CuriosityES(search.env_id, seed=0).learn(search.timesteps, callback=UntilFound())
    return act(model.evaluator, model.policy, model.best_episode_seed or 0)


def play_pretrained(algorithm: str, env_id: str) -> tuple[npt.NDArray[Any], int]:
    """Actions of the best episode of a policy of the package, and the seed of its reset."""
    policy, seed = load_pretrained(algorithm, env_id), pretrained_seed(algorithm, env_id)
    return act(make_evaluator(env_id, {"net_arch": policy.net_arch}), policy, seed or 0)


def act(evaluator: Evaluator, policy: MlpPolicy, seed: int) -> tuple[npt.NDArray[Any], int]:
    """Actions of an episode of a policy, and the seed of its reset."""
    return evaluator.evaluate(policy.vector[None], seed).trajectories[1][0], seed


def read_actions(env_id: str) -> tuple[npt.NDArray[Any], int]:
    """Actions of the plan that the tests replay, and the seed of its reset."""
    name = env_id.split("-")[1]
    with np.load(PLANS) as plans:
        return plans[name].astype(np.float32), int(plans[f"{name} seed"])


def draw_actions(env_id: str) -> tuple[npt.NDArray[Any], int]:
    """Random actions, held for some steps, to the end of an episode, and the seed of its reset."""
    env = gym.make(env_id)
    env.reset(seed=0)
    env.action_space.seed(0)
    actions: list[npt.NDArray[Any]] = []
    is_over = False
    while not is_over and len(actions) < N_STEPS:
        is_new = len(actions) % N_HELD == 0
        actions.append(env.action_space.sample() if is_new else actions[-1])
        _, _, terminated, truncated, _ = env.step(actions[-1])
        is_over = terminated or truncated
    env.close()
    return np.array(actions), 0


def film(env_id: str, actions: npt.NDArray[Any], seed: int) -> tuple[list[Frame], bool]:
    """At most `N_FRAMES` frames of an episode, and whether it came to the goal."""
    env = gym.make(env_id, render_mode="rgb_array")
    env.reset(seed=seed)
    stride = -(-len(actions) // N_FRAMES)
    frames: list[Frame] = []
    for t, action in enumerate(actions, 1):
        *_, info = env.step(action)
        if t % stride == 0 or t == len(actions):
            frames.append(np.asarray(env.render()))
    env.close()
    return frames, bool(info.get("is_success"))  # dense tasks have no goal


def play(name: str) -> tuple[str, npt.NDArray[Any], int]:
    """The environment of a picture, actions of an episode in it, and the seed of its reset."""
    if name in FOUND:
        return FOUND[name].env_id, *find_actions(FOUND[name])
    if name in PRETRAINED:
        return PRETRAINED[name][1], *play_pretrained(*PRETRAINED[name])
    if name in PLANNED:
        return PLANNED[name], *read_actions(PLANNED[name])
    return RANDOM[name], *draw_actions(RANDOM[name])


def shrink(frames: list[Frame]) -> list[Frame]:
    """Small frames of few colors, the same in all of them, for a page."""
    images = [Image.fromarray(frame) for frame in frames]
    size = round(images[0].width * HEIGHT / images[0].height), HEIGHT
    small = [np.asarray(image.resize(size, Image.Resampling.LANCZOS)) for image in images]
    return with_few_colors(small, N_COLORS)


def with_few_colors(frames: list[Frame], n_colors: int) -> list[Frame]:
    """Frames of so many colors, the same in all of them, so that nothing flickers."""
    shown = [frames[i] for i in (0, len(frames) // 2, -1)]
    palette = Image.fromarray(np.concatenate(shown)).quantize(n_colors)
    images = [Image.fromarray(frame) for frame in frames]
    few = [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
    return [np.asarray(image.convert("RGB")) for image in few]


def main(
    only: Annotated[str | None, typer.Option(help="Names, with commas; None: all.")] = None,
    out: Path = IMAGES,
) -> None:
    """Write a GIF for each environment."""
    known = [*FOUND, *PRETRAINED, *PLANNED, *RANDOM]
    names = known if only is None else only.split(",")
    if unknown := sorted(set(names) - set(known)):
        raise typer.BadParameter(f"--only knows {', '.join(known)}, not {', '.join(unknown)}.")
    out.mkdir(parents=True, exist_ok=True)
    for name in names:
        env_id, actions, seed = play(name)
        frames, success = film(env_id, actions, seed)
        write_film(shrink(frames), out / f"{name}.gif")
        print(f"{name}: {len(actions)} steps, {'at the goal' if success else 'at no goal'}")


if __name__ == "__main__":
    typer.run(main)
