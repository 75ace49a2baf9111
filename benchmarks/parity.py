"""RLeXplore's bonuses beside ours: `python -m benchmarks.parity` asks both about the same steps.

It needs `pip install --no-deps rllte-core termcolor nvidia-ml-py`: with its dependencies come other
versions of ours. Its modules are given the networks of ours, and no scales of their own, so that
nothing differs but the bonus.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Annotated, Any

import gymnasium as gym
import numpy as np
import numpy.typing as npt
import pandas as pd
import torch as th
import typer

from benchmarks.results import FOLDER
from curiosity_algos import APT, E3B, ICM, NGU, RND, Disagreement

N_ENVS, N_STEPS, N_FEATURES = 4, 50, 32
Steps = dict[str, th.Tensor]
Scores = npt.NDArray[Any]


def record(envs: gym.vector.VectorEnv[Any, Any, Any]) -> Steps:
    """Random steps as RLeXplore takes them, each entry (N_STEPS, N_ENVS, ...); no episode ends."""
    before, _ = envs.reset(seed=0)
    envs.action_space.seed(0)
    rows = []
    for _ in range(N_STEPS):
        actions = envs.action_space.sample()
        after, rewards, terminated, truncated, _ = envs.step(actions)
        rows.append((before, actions, rewards, terminated, truncated, after))
        before = after
    names = ["observations", "actions", "rewards", "terminateds", "truncateds", "next_observations"]
    columns = [th.as_tensor(np.stack(column)) for column in zip(*rows, strict=True)]
    return dict(zip(names, columns, strict=True))


def of_steps(ours: Any, steps: Steps) -> Scores:
    """Our bonus of each step."""
    names = "observations", "actions", "next_observations"
    return np.asarray(ours.score(*(steps[name].flatten(0, 1).numpy() for name in names)))


def of_episodes(ours: Any, steps: Steps) -> Scores:
    """Our bonus of all but the last step of each environment, one environment after the other."""
    observations, actions = steps["observations"].numpy(), steps["actions"].numpy()
    episodes = zip(observations.swapaxes(0, 1), actions.swapaxes(0, 1), strict=True)
    return np.concatenate([ours.score_trajectory(seen, taken[:-1]) for seen, taken in episodes])


def rnd(theirs: Any, ours: RND, steps: Steps) -> tuple[Scores, Scores]:
    """Errors of the same predictor."""
    theirs.predictor, theirs.target = ours.predictor, ours.target
    return N_FEATURES * theirs.compute(steps, sync=False).flatten().numpy(), of_steps(ours, steps)


def icm(theirs: Any, ours: ICM, steps: Steps) -> tuple[Scores, Scores]:
    """Errors of the same forward model."""
    theirs.encoder = ours.encoder
    theirs.fm = lambda features, actions: ours.forward_model(th.cat([features, actions], 1))
    squares = N_FEATURES * theirs.compute(steps, sync=False).flatten().numpy()
    return np.sqrt(squares), of_steps(ours, steps)


def disagreement(theirs: Any, ours: Disagreement, steps: Steps) -> tuple[Scores, Scores]:
    """What the same forward models differ in."""
    theirs.random_encoder, n = ours.encoder, len(ours.models)
    theirs.ensemble_size, theirs.ensemble = (
        n,
        [
            lambda features, actions, model=model: model(th.cat([features, actions], 1))
            for model in ours.models
        ],
    )
    variances = theirs.compute(steps, sync=False).flatten().numpy()
    return N_FEATURES * (n - 1) / n * variances, of_steps(ours, steps)


def e3b(theirs: Any, ours: E3B, steps: Steps) -> tuple[Scores, Scores]:
    """Of the same features."""
    theirs.encoder = ours.encoder
    return theirs.compute(steps, sync=False)[1:].T.flatten().numpy(), of_episodes(ours, steps)


def ngu(theirs: Any, ours: NGU, steps: Steps) -> tuple[Scores, Scores]:
    """Of the same features, before any training, and with our constants."""
    theirs.encoder = SimpleNamespace(encode=ours.encoder)
    theirs.kernel_epsilon, theirs.sm, theirs.dist_rms.mean = 1e-3, np.inf, th.ones(1)
    for i in range(N_STEPS):
        theirs.watch(*(steps[name][i] for name in steps))
    return np.array(theirs.n_eps, np.float32)[:, 1:].ravel(), of_episodes(ours, steps)


def re3(theirs: Any, ours: APT, steps: Steps) -> tuple[Scores, Scores]:
    """Distances to the nearest of the same features."""
    theirs.random_encoder, theirs.k, theirs.average_entropy = ours.encoder, 0, False
    known = steps["observations"].flatten(0, 1)
    ours.n_neighbors = 1
    ours.observe(known)
    stored = ours.encoder(known).detach()[:, None].expand(-1, N_ENVS, -1)
    theirs.storage, theirs.storage_full = stored, True
    far = 3.0 * steps["next_observations"]  # what is known has a distance of nothing but rounding
    asked = theirs.compute({**steps, "observations": far}, sync=False).flatten().numpy()
    return np.expm1(asked), of_steps(ours, {**steps, "next_observations": far})


Compare = Callable[[Any, Any, Steps], tuple[Scores, Scores]]
COMPARED: dict[str, tuple[Callable[..., Any], Compare, str]] = {
    "RND": (RND, rnd, "theirs is the mean of the squares, ours their sum"),
    "ICM": (ICM, icm, "theirs is the mean of the squares, ours the root of their sum"),
    "Disagreement": (
        Disagreement,
        disagreement,
        "theirs averages variances over n - 1 models, ours adds up those over n",
    ),
    "E3B": (E3B, e3b, "theirs scores where a step begins, ours where it leads"),
    "PseudoCounts": (
        NGU,
        ngu,
        "the episodic part; theirs scores where a step begins, has an epsilon of 1e-4, pays "
        "nothing where the root is above 8, and divides by the mean of the distances that it has "
        "asked for, ours by that in training batches",
    ),
    "RE3": (
        APT,
        re3,
        "theirs is the logarithm of 1 + the distance, here to the nearest, scores where a step "
        "begins, and remembers the last 1,000 of each environment",
    ),
}
"""Their class: ours, how both are asked, and what differs but for that."""


def main(out: Annotated[Path, typer.Option(help="Folder of the CSV file.")] = FOLDER) -> None:
    """Write how far theirs and ours lie apart, as a share of the largest bonus."""
    from rllte.xplore import reward

    envs = gym.make_vec("CuriosityMaze-US-v0", N_ENVS, vectorization_mode="vector_entry_point")
    spaces = envs.single_observation_space, envs.single_action_space
    steps = record(envs)
    rows = []
    for name, (kind, compare, text) in COMPARED.items():
        plain = {"obs_norm_type": "none", "latent_dim": N_FEATURES, "rwd_norm_type": "none"}
        theirs = getattr(reward, name)(envs, "cpu", **plain)
        ours = kind(*spaces, normalize=False, seed=0, device="cpu")
        one, other = compare(theirs, ours, steps)
        apart = np.abs(one - other).max() / np.abs(other).max()
        rows.append([name, kind.__name__, text, f"{apart:.0e}"])
    columns = ["RLeXplore", "here", "what differs", "apart, of the largest"]
    pd.DataFrame(rows, columns=columns).to_csv(out / "parity.csv", index=False)


if __name__ == "__main__":
    typer.run(main)
