"""Searches on the maze of pyribs' tutorial: `python -m benchmarks.kheperax NAME SEED`.

pyribs' tutorial `ns_maze` plays Kheperax's maze with a target: 375,000 episodes of 250 steps, by
policies of 138 weights. It counts in how many cells of a grid episodes end. Here searches play as
many episodes with as many weights, and are counted alike.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from ribs.archives import ProximityArchive
from ribs.emitters import EvolutionStrategyEmitter
from ribs.schedulers import Scheduler

from benchmarks.kheperax_maze import (
    EPISODE,
    HIDDEN,
    MLP,
    KheperaxEvaluator,
    KheperaxSpaces,
    Record,
)
from benchmarks.measure import markdown
from benchmarks.results import FOLDER, add_rows, read_curves, read_rows
from curiosity_algos import NSES, NSLC, CuriosityES, CuriosityMAPElites

KEYS = ["algorithm", "seed"]
N_POLICIES = 150
"""Of a generation, as many as pyribs' five emitters give."""
STEPS = 2500 * N_POLICIES * EPISODE
"""pyribs' budget; an episode counts whole, even if it comes to the target before."""
N_POINTS = 100
"""Of a curve."""


def learn(algorithm: Any, evaluator: KheperaxEvaluator, seed: int, **settings: Any) -> None:
    """Let a search of this package play, with its defaults beside these settings."""
    model = algorithm(
        KheperaxSpaces(),
        policy_kwargs={"net_arch": HIDDEN},
        evaluator=evaluator,
        population_size=N_POLICIES,
        seed=seed,
        n_threads=1,
        device="cpu",
        **settings,
    )
    record = evaluator.record
    steps = record.n_episodes * EPISODE
    model.learn(steps, lambda *_: not record.is_full, log_interval=None)


def novelty_search(evaluator: KheperaxEvaluator, seed: int) -> None:
    """The tutorial's own search, with a seed."""
    import jax

    # As Kheperax begins its networks: LeCun's uniform weights, and no biases.
    keys = jax.random.split(jax.random.PRNGKey(seed), len(MLP.sizes) - 1)
    draw = jax.nn.initializers.lecun_uniform()
    x0 = np.concatenate(
        [
            np.append(draw(key, (n_in, n_out)), np.zeros(n_out))
            for key, (n_in, n_out) in zip(keys, pairwise(MLP.sizes.tolist()), strict=True)
        ]
    )
    archive = ProximityArchive(
        solution_dim=x0.size, measure_dim=2, k_neighbors=15, novelty_threshold=0.01, seed=seed
    )
    rules = {"ranker": "nov", "selection_rule": "mu", "restart_rule": "basic"}
    size = N_POLICIES // 5
    seeds = np.random.SeedSequence(seed).generate_state(5).tolist()
    emitters = [
        EvolutionStrategyEmitter(archive, x0=x0, sigma0=0.5, batch_size=size, seed=each, **rules)
        for each in seeds
    ]
    scheduler = Scheduler(archive, emitters)
    while not evaluator.record.is_full:
        rollouts = evaluator.evaluate(scheduler.ask())
        scheduler.tell(rollouts.returns, rollouts.behaviors)


NO, YES = "no", "yes"
"""Whether a search is told where episodes end."""
SEARCHES: dict[str, tuple[str, Callable[[KheperaxEvaluator, int], None]]] = {
    "CuriosityES": (NO, partial(learn, CuriosityES)),
    "NSLC, learned": (NO, partial(learn, NSLC, behavior="learned")),
    "CuriosityMAPElites": (YES, partial(learn, CuriosityMAPElites)),
    "NSES": (YES, partial(learn, NSES)),
    "pyribs": (YES, novelty_search),
}
"""By name whether a search is told positions, and the search."""
PUBLISHED = 88.93
"""Coverage in percent, of https://docs.pyribs.org/en/stable/tutorials/ns_maze.html."""


def main(
    name: Annotated[str, typer.Argument(help=f"One of {', '.join(SEARCHES)}.")],
    seed: int,
    steps: Annotated[float, typer.Option(min=EPISODE, help="The budget.")] = STEPS,
    smoke: Annotated[bool, typer.Option(help="Play 600 episodes, and keep no row.")] = False,
    out: Annotated[Path, typer.Option(help="Where the CSV files go.")] = FOLDER,
) -> None:
    """Search until the budget is spent, and note the coverage."""
    if name not in SEARCHES:
        raise typer.BadParameter(f"The name is one of {', '.join(SEARCHES)}, not {name}.")
    record = Record(600 if smoke else int(steps) // EPISODE)
    evaluator = KheperaxEvaluator(record)
    out.mkdir(parents=True, exist_ok=True)  # an error comes before the search
    begin = time.process_time()
    SEARCHES[name][1](evaluator, seed)
    seconds = time.process_time() - begin
    row = {"algorithm": name, "seed": seed, "steps": record.n_episodes * EPISODE}
    row |= {"coverage": record.coverage(), "seconds": round(seconds)}
    typer.echo(row)
    if not smoke:
        add_rows(pd.DataFrame([row]), out / "kheperax.csv", KEYS)
        add_rows(pd.DataFrame(curve(record, name, seed)), out / "kheperax_curves.csv", KEYS)


def curve(record: Record, name: str, seed: int) -> list[dict[str, Any]]:
    """The coverage after each hundredth of the budget."""
    times = (np.linspace(0.0, record.n_episodes, N_POINTS + 1)[1:]).astype(int)
    return [
        {"algorithm": name, "seed": seed, "steps": n * EPISODE, "coverage": record.coverage(n)}
        for n in times.tolist()
    ]


def table(folder: Path = FOLDER) -> str:
    """A row for each search, whole runs first, and one of what pyribs' page reports."""
    runs, curves = read_rows("kheperax", folder), read_curves("kheperax", folder)
    published = ["pyribs, as its page reports", YES, "", f"{PUBLISHED:.1f}", ""]
    rows = [((True, PUBLISHED), published)]
    for name, group in runs.groupby("algorithm"):
        own = curves[curves["algorithm"] == name]
        early, late = (100.0 * own.loc[own["steps"] == n, "coverage"] for n in (STEPS / 10, STEPS))
        pace = (1e6 * group["seconds"] / group["steps"]).median()
        cells = [_span(early), _span(late), "" if np.isnan(pace) else f"{pace:.1f}"]
        is_whole = len(late) > 0
        rank = is_whole, (late if is_whole else early).median()
        rows.append((rank, [name, SEARCHES[name][0], *cells]))
    rows.sort(reverse=True)
    budgets = [f"Coverage (%), {n / 1e6:.4g} M steps" for n in (STEPS / 10, STEPS)]
    head = ["Search", "Told positions", *budgets, "Processor seconds per M steps"]
    return markdown(head, [cells for _, cells in rows])


def _span(shares: pd.Series) -> str:
    if len(shares) < 2:
        return "".join(shares.map("{:.1f}".format))
    return f"{shares.median():.1f} ({shares.min():.1f} to {shares.max():.1f})"


if __name__ == "__main__":
    typer.run(main)
