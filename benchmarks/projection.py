"""Project the last states of the episodes of rewarding policies, and draw them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from sklearn.decomposition import PCA
from typer import BadParameter

from benchmarks.plan import NAMES
from curiosity_algos.common.arrays import Float32Array, Float64Array, Int64Array
from curiosity_algos.evaluation.evaluator import make_evaluator, replay
from curiosity_algos.evaluation.flat_spaces import FlatObservations
from curiosity_algos.evaluation.rollouts import Rollouts
from curiosity_algos.experiments.canvas import add_note, add_title, make_panels, polish
from curiosity_algos.experiments.env_spec import make_env
from curiosity_algos.experiments.export.policies import draw
from curiosity_algos.experiments.labels import color_labels
from curiosity_algos.experiments.loading import Run
from curiosity_algos.experiments.run_folder import REWARDING, read_arrays

N_STATES = 300
"""Last states of an episode, as many as in the paper."""
MOST_POLICIES = 500
"""Most policies of a run: their states are in memory at once, 43 kB a policy on a maze."""
TITLE = f"The last {N_STATES} states of rewarding policies: {{}}"
NOTE = (
    "Principal components of up to 500 rewarding policies of each run; in brackets how many there "
    "are of all runs. "
    f"An episode shorter than {N_STATES} states counts as if it had waited at its start."
)


class Rewarding(NamedTuple):
    """The last states (n, N_STATES, O) of rewarding policies' episodes, and the returns (n,)."""

    states: Float32Array
    returns: Float64Array


def replay_rewarding(run: Run) -> Rewarding:
    """Play rewarding policies of a run again, with the seeds of their episodes.

    Args:
        run: Run with a checkpoint. `MOST_POLICIES` are drawn where there are more.

    Raises:
        FileNotFoundError: If there is no run.
        ValueError: If it is damaged, or its environment is not one that is known here.
    """
    stored = run.folder.read(lambda last: read_arrays(last / "rewarding.npz", REWARDING))
    places = draw(np.arange(len(stored["return"])), MOST_POLICIES)
    parameters, seeds = stored["parameters"][places], stored["episode_seed"][places]
    returns = np.empty(len(seeds))
    with closing(make_env(run.description, trust=False)) as env:
        evaluator = make_evaluator(env, run.description["settings"]["policy_kwargs"], 1)
        n_observed = FlatObservations(env.observation_space).size
        states = np.empty((len(seeds), N_STATES, n_observed), dtype=np.float32)
        for batch, rollouts in replay(evaluator, parameters, seeds):
            states[batch], returns[batch] = last_states(rollouts), rollouts.returns
    return Rewarding(states, returns)


def last_states(rollouts: Rollouts, n: int = N_STATES) -> Float32Array:
    """The last n states of P episodes, (P, n, O); shorter episodes repeat their first state."""
    observations, _ = rollouts.trajectories
    times = rollouts.lengths[:, None] + np.arange(1 - n, 1)
    last: Float32Array = observations[np.arange(len(times))[:, None], np.maximum(times, 0)]
    return last


class Projection(NamedTuple):
    """Rewarding policies of several algorithms, by the two principal components of their states.

    Attributes:
        algorithms: Names, also of algorithms without a rewarding policy.
        owners: (n,) index of each policy's algorithm.
        scores: (n, 2).
        returns: (n,).
        shares: (2,) of the variance, by component.
    """

    algorithms: tuple[str, ...]
    owners: Int64Array
    scores: Float64Array
    returns: Float64Array
    shares: Float64Array


def project_rewarding(rewarding: Mapping[str, Sequence[Rewarding]]) -> Projection:
    """Project the rewarding policies of several algorithms' runs together.

    Raises:
        typer.BadParameter: If there are fewer than three policies in all.
    """
    numbers = [sum(len(run.returns) for run in runs) for runs in rewarding.values()]
    if sum(numbers) < 3:
        raise BadParameter("`runs` must have 3 rewarding policies, they have fewer.")
    pooled = [run for runs in rewarding.values() for run in runs]
    states = np.concatenate([run.states for run in pooled])
    pca = PCA(2, svd_solver="arpack", random_state=0)  # exact, and no more than two are computed
    return Projection(
        algorithms=tuple(rewarding),
        owners=np.repeat(np.arange(len(rewarding)), numbers),
        scores=pca.fit_transform(states.reshape(len(states), -1)),
        returns=np.concatenate([run.returns for run in pooled]),
        shares=pca.explained_variance_ratio_,
    )


def show_projection(projection: Projection, n_rewarding: Sequence[int], about: str) -> Figure:
    """Draw projected policies, on the left by algorithm, on the right by return.

    Args:
        projection: Some of the rewarding policies.
        n_rewarding: How many there are, of each algorithm.
        about: Of which runs.
    """
    algorithms, owners, scores, returns, shares = projection
    order = np.random.default_rng(0).permutation(len(scores))  # none is hidden by what came later
    colors = color_labels(algorithms)

    figure, ((left, right),) = make_panels(1, 2, width=5.0, height=4.0)
    _scatter(left, scores[order], shares, c=np.array(list(colors.values()))[owners[order]])
    dots = _scatter(right, scores[order], shares, c=returns[order], cmap="viridis")
    left.set_title("by algorithm")
    right.set_title("by return")
    figure.colorbar(dots, ax=right, label="return")
    samples = []
    for (algorithm, color), n in zip(colors.items(), n_rewarding, strict=True):
        name = NAMES.get(algorithm, algorithm)
        label = f"{name} ({n:,})" if n else f"{name} (no reward)"
        samples.append(Line2D([], [], linestyle="", marker="o", color=color, label=label))
    add_title(figure, TITLE.format(about), samples)
    add_note(figure, NOTE)
    return figure


def _scatter(ax: Axes, scores: Float64Array, shares: Float64Array, **colors: Any) -> PathCollection:
    x, y = scores.T
    dots = ax.scatter(x, y, s=9, linewidths=0, rasterized=True, **colors)
    ax.set(
        xlabel=f"component 1 ({shares[0]:.0%} of the variance)",
        ylabel=f"component 2 ({shares[1]:.0%} of the variance)",
    )
    polish(ax)
    return dots
