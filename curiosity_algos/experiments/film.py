"""A moving picture of a run's best policy."""

from __future__ import annotations

from pathlib import Path

import gymnasium as gym
import numpy as np
import numpy.typing as npt
from PIL import Image

from curiosity_algos.experiments.names import find_algorithm
from curiosity_algos.experiments.replay import episode
from curiosity_algos.experiments.run_folder import RunFolder
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_choice

Frame = npt.NDArray[np.uint8]


def film(folder: Path, path: Path, *, stride: int, seed: int) -> float:
    """Play one episode, and write every `stride`-th step as a frame; its return.

    Raises:
        FileNotFoundError: If there is no run in the folder.
        ValueError: If it has no checkpoint, or its environment was not made by an id; if the path
            is of another kind of file.
    """
    check_choice((".gif", ".mp4"), out=path.suffix)
    run = RunFolder(folder)
    described = run.describe()
    if described["wrappers"]:
        raise ValueError(f"`run` must be of an environment without wrappers of its own: {folder}.")
    if run.checkpoint is None or described["env"] is None:
        raise ValueError(f"`run` must have a checkpoint, and an environment by its id: {folder}.")
    model = find_algorithm(described["algorithm"]).load(run.checkpoint / "model")
    env = gym.make(described["env"], render_mode="rgb_array", **described["env_kwargs"])
    frames, total = [], 0.0
    for t, step in enumerate(episode(model, env, seed)):
        total += step.reward
        if t % stride == 0:
            frames.append(_frame(env))
    frames.append(_frame(env))
    env.close()
    path.parent.mkdir(parents=True, exist_ok=True)
    _write(frames, path)
    return total


def _frame(env: gym.Env[object, object]) -> Frame:
    frame = env.render()
    assert isinstance(frame, np.ndarray)
    return frame


def _write(frames: list[Frame], path: Path) -> None:
    """20 frames a second."""
    if path.suffix == ".gif":
        first, *others = [Image.fromarray(frame) for frame in frames]
        first.save(path, save_all=True, append_images=others, duration=50, loop=0)
        return
    (moviepy,) = import_extra("render", "moviepy")
    moviepy.ImageSequenceClip(frames, fps=20).write_videofile(str(path), logger=None)
