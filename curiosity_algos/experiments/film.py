"""Show the best policy of a run, or one that comes with the package, in a window or a film.

The functions raise FileNotFoundError if there is no run, ValueError if it cannot be played.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeAlias

import gymnasium as gym
import numpy as np
from PIL import Image
from stable_baselines3.common.policies import BasePolicy

from curiosity_algos.common.names import KNOWN, find_algorithm
from curiosity_algos.evaluation.episode import actor, steps
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_algos.evaluation.found import is_success
from curiosity_algos.experiments.baselines import load_baseline_policy
from curiosity_algos.experiments.env_spec import given_or_made, make_env
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.pretrained import load_pretrained, pretrained_seed
from curiosity_algos.loops.evolutionary_algorithm import EvolutionaryAlgorithm
from curiosity_algos.loops.model_file import load_policy
from curiosity_algos.robust.measure import Starts, play_each
from curiosity_algos.state.atomic_file import atomic_file
from curiosity_gym.core import Frame
from curiosity_gym.extras import import_extra
from curiosity_gym.validation import check_choice

SEEN_THROUGH = {"BonusVecEnvWrapper", "DemonstrationStarts", "FreshMonitor", "VecTransposeImage"}
"""Wrappers of a VecEnv that do not change what a policy acts on."""

N_COLUMNS = 5
"""Films in a row, at most."""
AnyEnv: TypeAlias = gym.Env[Any, Any] | None
Source: TypeAlias = Path | tuple[str, str]
"""The folder of a run, or the algorithm and environment of a policy of the package."""


def film(
    source: Source,
    path: Path,
    *,
    stride: int,
    seed: int | None = None,
    n_starts: int = 1,
    trust: bool = False,
    env: AnyEnv = None,
) -> Starts:
    """Play episodes, write every `stride`-th step as a frame, and say what they came to.

    Args:
        source: Run or policy that acts.
        path: Path of the GIF or MP4.
        stride: Steps from frame to frame.
        seed: Seed of the environment; None: that of the policy's best episode, or 0.
        n_starts: Episodes side by side, whose seeds count up.
        trust: Also run code that the folder of the run names or contains.
        env: Environment like the run's, with the `render_mode` "rgb_array"; None: the one that
            `run.json` describes.
    """
    check_choice((".gif", ".mp4"), out=path.suffix)
    if path.suffix == ".mp4":
        import_extra("video", "moviepy")  # before the episode is played
    with _open(source, trust, env, render_mode="rgb_array") as (policy, played, best_seed):
        if played.has_wrapper_attr("num_repeats"):  # a RepeatAction's, whose steps are so many
            stride = max(1, stride // played.get_wrapper_attr("num_repeats"))
        first = best_seed if seed is None else seed
        episodes = [_film(policy, played, first + i, stride) for i in range(n_starts)]
    films, success, totals = zip(*episodes, strict=True)
    write_film(side_by_side(films), path)
    return Starts(np.array(success), np.array(totals))


def _film(
    policy: BasePolicy, env: gym.Env[Any, Any], seed: int, stride: int
) -> tuple[list[Frame], bool, float]:
    """The frames of an episode, whether it succeeds, and its return."""
    observation, _ = env.reset(seed=seed)
    frames: list[Any] = [env.render()]
    total, success, t = 0.0, False, 0
    for t, (reward, info) in enumerate(steps(env, observation, actor(policy)), 1):
        total += reward
        success = is_success(info, total)
        if t % stride == 0:
            frames.append(env.render())
    if t % stride:  # the last frame always
        frames.append(env.render())
    return frames, success, total


def can_draw(run: Path) -> bool:
    """Whether the environment of a run, whose code is trusted, says that it draws pictures."""
    with closing(make_env(Run(run).description, trust=True)) as env:
        return "rgb_array" in env.metadata.get("render_modes", ())


def side_by_side(films: Sequence[list[Frame]]) -> list[Frame]:
    """Films in rows of five, at half their size if they are several; one that is over stands."""
    if len(films) == 1:
        return films[0]
    small = [[frame[::2, ::2] for frame in film] for film in films]
    n_rows = -(-len(small) // N_COLUMNS)
    n_columns = -(-len(small) // n_rows)
    height, width, _ = small[0][0].shape
    tiled = []
    for t in range(max(map(len, small))):
        picture = np.zeros((n_rows * height, n_columns * width, 3), np.uint8)
        for i, film in enumerate(small):
            y, x = i // n_columns * height, i % n_columns * width
            picture[y : y + height, x : x + width] = film[min(t, len(film) - 1)]
        tiled.append(picture)
    return tiled


def watch(source: Source, **arguments: Any) -> Starts:
    """Play one episode in a window, and say what it came to. Arguments are those of `play`."""
    (pygame,) = import_extra("render", "pygame")
    try:
        return play(source, **arguments, render_mode="human")
    except pygame.error as error:
        raise ValueError(f"`out` must name a file where there is no screen: {error}.") from error


def play(
    source: Source,
    *,
    seed: int | None = None,
    n_starts: int = 1,
    trust: bool = False,
    env: AnyEnv = None,
    **rendering: Any,
) -> Starts:
    """Play episodes, and say what they came to. Arguments are those of `film`."""
    with _open(source, trust, env, **rendering) as (policy, played, best_seed):
        return play_each(policy, played, n_starts, best_seed if seed is None else seed)


@contextmanager
def _open(
    source: Source, trust: bool, env: AnyEnv, **rendering: Any
) -> Iterator[tuple[BasePolicy, gym.Env[Any, Any], int]]:
    """A policy, an environment like that of its training, and the seed of its best episode."""
    if isinstance(source, tuple):
        with given_or_made(env, partial(gym.make, source[1], **rendering)) as played:
            yield load_pretrained(*source), played, pretrained_seed(*source) or 0
        return
    run = Run(source)
    cls = _algorithm(run.description)
    with given_or_made(env, partial(make_env, run.description, trust=trust, **rendering)) as played:
        policy, seed = run.folder.read(partial(_load, cls, run.description, played, trust))
        spaces = policy.observation_space, played.observation_space
        if len({FlatObservations(space).size for space in spaces}) > 1:
            name = run.description["env"]
            raise ValueError(f"`run` must be of its environment: {name} has other observations.")
        yield policy, played, seed


def _load(
    cls: type[Any],
    described: Mapping[str, Any],
    env: gym.Env[Any, Any],
    trust: bool,
    checkpoint: Path,
) -> tuple[BasePolicy, int]:
    """The policy of a checkpoint, and the seed of its best episode; 0 where that is not known."""
    if issubclass(cls, EvolutionaryAlgorithm):
        return load_policy(checkpoint / "model", cls, env)
    if trust:
        return cls.load(checkpoint / "model").policy, 0
    return load_baseline_policy(cls, checkpoint, described, env), 0


def _algorithm(described: Mapping[str, Any]) -> type[Any]:
    """The class of a run's algorithm; its policy must act on the environment's observations."""
    name = described["algorithm"].partition(" + ")[0]
    wrappers = {*(described.get("vec_env") or {}).get("wrappers", {})} - SEEN_THROUGH
    if name not in KNOWN or wrappers:
        raise ValueError(
            "`run` must be of an algorithm that `curiosity list` names, and of a policy that acts "
            f"on the environment's own observations, it is of {', '.join([name, *wrappers])}. Load "
            "its model, and call `predict`."
        )
    return find_algorithm(name)


def write_film(frames: list[Frame], path: Path) -> None:
    """Write frames as a .gif or .mp4, 20 a second; the file appears once it is whole."""
    if path.suffix == ".gif":
        first, *others = [Image.fromarray(frame) for frame in frames]
        with atomic_file(path) as file:
            first.save(file, "GIF", save_all=True, append_images=others, duration=50, loop=0)
        return
    (moviepy,) = import_extra("video", "moviepy")
    clip = moviepy.ImageSequenceClip(frames, fps=20)
    with TemporaryDirectory() as folder, atomic_file(path) as file:
        encoded = Path(folder, path.name)  # the encoder writes to no file that is open
        clip.write_videofile(str(encoded), logger=None)
        file.write(encoded.read_bytes())
