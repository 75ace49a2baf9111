"""What the pages about the paper say in prose, and the numbers that the committed runs have for it.

Each statement is a sentence of a page, with its numbers made from the data. A number of a page that
stands in no statement is one that was given: a setting, or the paper's own. Numbers in words, and
who is ahead of whom, are not checked.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.paper import Tables, evidence
from benchmarks.plan import BUDGETS, CONTROL, MAZES
from benchmarks.results import read_rows
from benchmarks.run_numbers import (
    N_POLICIES,
    US,
    Float64,
    expected_kinds,
    measured,
    numbers_of,
    with_regions,
)
from curiosity_algos.experiments.canvas import short_name

DOCS = Path(__file__).parents[1] / "docs"
SNAKE, _, HARD = MAZES
BALL, FINGER, STACKER = CONTROL
STRATEGIES = "CuriosityES", "NSES"
GIVEN = {
    "paper.md": "0 1 2 3 4 5 6 7 8 .5 .005 .8 20 28 50 56 83 400 500 2,000 10,000 1e-4 2.24e8",
    "paper_claims.md": "0 2 3 5 95",
    "paper_today.md": "0 1 2 3 4 5 6 7 8 95 3e7 1e6",
}
"""Numbers that no run has come to, of pages that have no others."""
NUMBER = re.compile(r"(?<![\w.])\.?\d[\d,.]*(?:e-?\d+)?(?<![,.])")
NOT_PROSE = re.compile(r"^(\||#|`{3,}|```|:|<|\s+--).*$|`[^`]*`|<!--.*?-->", flags=re.MULTILINE)


def faults(page: str) -> list[str]:
    """What a page says otherwise than the data, and its numbers that stand for nothing."""
    text = re.sub(r"\]\([^)]*\)", "]", (DOCS / page).read_text())
    said, statements = one_line(text), STATEMENTS[page]()
    missing = [each for each in statements if each not in said]
    prose = one_line(
        NOT_PROSE.sub("", re.sub(r"<!-- table .*?<!-- end[^>]*>", "", text, flags=re.S))
    )
    for each in statements:
        prose = prose.replace(one_line(NOT_PROSE.sub("", each)), "")
    unknown = sorted(set(NUMBER.findall(prose)) - set(GIVEN[page].split())) if page in GIVEN else []
    return [f"not said: {each}" for each in missing] + [f"of no run: {each}" for each in unknown]


def one_line(text: str) -> str:
    """A text without its ends of lines."""
    return " ".join(text.split())


def of_paper() -> list[str]:
    """Of the page "The paper, figure by figure"."""
    formula, code = evidence("paper"), evidence("public")
    rewarding = [
        [
            numbers_of(code, "rewarding policies", name, env).mean()
            for name in ("NSES", "CuriosityES")
        ]
        for env in MAZES
    ]
    more = ", ".join(
        f"{ours:,.0f} against {theirs:,.0f} in {short_name(env)}"
        for (ours, theirs), env in zip(rewarding, MAZES, strict=True)
    )
    regions = _regions_of_equally_many(code)
    (cma_me,), ours = regions["CMAME"], regions["CuriosityES"]
    rates = [f"icm_learning_rate={rate},step=canonical" for rate in ("0.00001", "0.001")]
    few = [
        int(numbers_of(formula, "rewarding policies", "CuriosityES", SNAKE, each)[0])
        for each in rates
    ]
    same_seed = numbers_of(code, "rewarding policies", "CuriosityES", SNAKE)[0]
    episodes = (
        formula.table("runs").set_index(["algorithm", "env"])["n_episodes"]["MAPElites", US].min()
    )
    return [
        *_in_five_sentences(formula, code),
        _budgets(formula),
        _seeds(formula),
        f"end in {_least_covered(code)} % of the cells or more, except for one run of Curiosity-ES "
        "in Snake",
        f"(means of a run: {more})",
        f"are in {cma_me:.0f} regions of [figure 8], fifty of a run of Curiosity-ES in "
        f"{min(ours):.0f} to {max(ours):.0f}",
        f"reaches the goal of Snake in {min(few)} or {max(few)} of {_thousands(episodes)} episodes",
        f"the same seed reaches it {_thousands(same_seed)} times",
        *_of_control(formula),
        f"a run of MAP-Elites finds a handful in {_thousands(episodes)} episodes",
    ]


def _of_control(formula: Tables) -> list[str]:
    """Of the control tasks, with the formula's step."""
    cup = [
        numbers_of(formula, "coverage", "CuriosityES", BALL, each).mean()
        for each in ("phi=0.0", "")
    ]
    alone = {
        name: [numbers_of(formula, "coverage", name, env, variant).mean() for env in CONTROL]
        for name, variant in [*((each, "phi=0.0") for each in STRATEGIES), *DESCRIBED]
    }
    stacker = sorted(alone["CuriosityES"][2] / alone[name][2] for name, _ in DESCRIBED)
    finger = measured("coverage", formula)
    finger = finger[finger.index.get_level_values("env") == FINGER]
    found = {
        key: numbers_of(formula, "first reward", *key) / 1e6
        for key in [("TD3ICM", BALL), ("TD3ICM", STACKER), ("CuriosityES", STACKER)]
    }
    ours_in_stacker = found["CuriosityES", STACKER]
    without = numbers_of(formula, "first reward", "CuriosityES", BALL, "phi=0.0") / 1e6
    return [
        f"On BallInCup it covers {cup[0] / cup[1]:.0f} times as much",
        f"finds that of BallInCup in {_share(found['TD3ICM', BALL])} runs, within "
        f"{_up(found['TD3ICM', BALL], 2)} M steps, and that of Stacker in "
        f"{_share(found['TD3ICM', STACKER])}",
        f"Curiosity-ES finds the reward of Stacker in {_share(ours_in_stacker)} runs, after "
        f"{np.nanmin(ours_in_stacker):.1f} M steps",
        f"finds the reward of BallInCup in {_share(without)} runs, after {without.min():.1f} to "
        f"{without.max():.1f} M steps",
        f"it covers {alone['CuriosityES'][0] / alone['NSES'][0]:.0f} times as much as NS-ES",
        f"{stacker[0]:.1f} to {stacker[1]:.1f} times as much as MAP-Elites and CMA-ME",
        f"a run covers {_up(100 * finger, 0)} % at most",
    ]


def _in_five_sentences(formula: Tables, code: Tables) -> list[str]:
    """The first section of the page."""

    def found(tables: Tables, name: str) -> str:
        return _share(_in_mazes(tables, "first reward", name))

    ours = np.concatenate([_in_mazes(code, "rewarding policies", name) for name in STRATEGIES])
    fewest = ours[ours > 0].min()
    theirs = [_in_mazes(formula, "rewarding policies", name) for name, _ in DESCRIBED]
    searches = read_rows("dynamics")
    slowest = searches["first_success_timesteps"].max() / BUDGETS["paper"].timesteps("NSES", US)
    return [
        f"NS-ES finds the goal in {found(code, 'NSES')} runs and Curiosity-ES in "
        f"{found(code, 'CuriosityES')}, with {fewest:,.0f} rewarding policies or more",
        f"NS-ES finds it in {found(formula, 'NSES')} runs and Curiosity-ES in "
        f"{found(formula, 'CuriosityES')}, behind CMA-ME with {found(formula, 'CMAME')} and "
        f"MAP-Elites with {found(formula, 'MAPElites')}, which have {np.max(theirs):.0f} rewarding "
        "policies in a run at most",
        f"all {len(searches)} searches find the goal within {np.ceil(1e3 * slowest) / 10:.1f} % of "
        "the budget",
        f"NSLC finds the goal in {found(code, 'NSLC')} runs and AURORA in {found(code, 'AURORA')}",
    ]


def _in_mazes(tables: Tables, measure: str, algorithm: str) -> Float64:
    """A measure of each run in all mazes."""
    return np.concatenate([numbers_of(tables, measure, algorithm, env) for env in MAZES])


def of_readme() -> list[str]:
    """Of README, about the paper."""
    return [
        f"end in {_least_covered(evidence('public'))} % of their cells or more, except for one run"
    ]


def _least_covered(tables: Tables) -> int:
    """Percent of the cells that all runs cover, the worst of curiosity in Snake aside."""
    aside = numbers_of(tables, "coverage", "CuriosityES", SNAKE).min()
    cells = np.concatenate([_in_mazes(tables, "coverage", name) for name in STRATEGIES])
    return int(100 * cells[cells > aside].min())


DESCRIBED = ("MAPElites", ""), ("CMAME", "")
"""Algorithms that explore alike whether reward counts or not."""


def _budgets(tables: Tables) -> str:
    """What the runs had."""
    runs = tables.table("runs").groupby(["algorithm", "env"])["timesteps"].max()
    cup, stacker = (_power(runs["MAPElites", env], 2) for env in (BALL, STACKER))
    maze, control, fewest = (_power(runs["TD3ICM", env], 0) for env in (SNAKE, FINGER, STACKER))
    return (
        f"BallInCup and Finger have a tenth of the code's budget ({cup} steps), Stacker a "
        f"fiftieth ({stacker}). A step of TD3ICM costs as much as hundreds of a population's. Its "
        f"runs have {maze} steps of a maze, {control} of BallInCup and Finger, and {fewest} of "
        "Stacker."
    )


def _seeds(tables: Tables) -> str:
    """Which seeds all have."""
    seeds = tables.table("runs").groupby(["algorithm", "env", "variant"])["seed"].max()
    return f"seeds 0 to {seeds.mode().item()}"


def _regions_of_equally_many(tables: Tables) -> dict[str, list[float]]:
    """The regions that `N_POLICIES` rewarding policies of each run are expected to be in."""
    found: dict[str, list[float]] = {}
    policies = with_regions(tables.table("projection"))
    for (name, _, _), rows in policies.groupby(["algorithm", "variant", "seed"]):
        if len(rows) >= N_POLICIES:
            found.setdefault(name, []).append(expected_kinds(rows["region"]))
    return found


def of_choices() -> list[str]:
    """Of the page "What the paper leaves open, and what was chosen"."""
    searches, drawn = read_rows("dynamics"), read_rows("dynamics_random")
    last = searches["first_success_timesteps"].max() / 1e6
    (n,) = drawn["policies"].unique()
    return [
        f"We drew {n:,} policies",
        f"All {len(searches)} runs found the goal within {np.ceil(10 * last) / 10:.1f} million "
        f"steps, of {BUDGETS['paper'].timesteps('NSES', US) / 1e6:.0f} million in a run",
    ]


def of_today() -> list[str]:
    """Of the page "The paper's figures with today's settings"."""
    tables = evidence("tuned")
    firsts = np.concatenate(
        [numbers_of(tables, "first reward", name, env) for name in STRATEGIES for env in MAZES]
    )
    covered = {
        name: min(numbers_of(tables, "coverage", name, env).min() for env in MAZES)
        for name in STRATEGIES
    }
    named = (*STRATEGIES, "MAPElites")
    cup = np.concatenate([numbers_of(tables, "first reward", name, BALL) for name in named])
    rewarding = numbers_of(tables, "rewarding policies", "CuriosityES", US)
    regions = numbers_of(tables, "regions", "CuriosityES", US)
    episodes = tables.table("runs").set_index(["algorithm", "env"])["n_episodes"]
    return [
        f"find the goal in every run, {(firsts <= 5e6).sum()} of {len(firsts)} times within 5 M "
        "steps",
        f"in {int(100 * covered['CuriosityES'])} % of the cells or more; NS-ES in "
        f"{int(100 * covered['NSES'])} % or more",
        f"BallInCup's within {_up(cup / 1e6, 1)} M steps",
        f"A run of Curiosity-ES finds {rewarding.min():.0f} to {rewarding.max():,.0f} rewarding "
        f"policies in some {_thousands(episodes['CuriosityES', US].mean())} episodes, in "
        f"{regions.min():.0f} to {regions.max():.0f} of the 400 regions",
    ]


def of_claims() -> list[str]:
    """Of the page "The paper, claim by claim"."""
    return [f"The runs with the paper's settings have {_seeds(evidence('paper'))}"]


def of_reproduce() -> list[str]:
    """Of the page "The paper's figures"."""
    runs = evidence("paper").table("runs")
    td3 = runs[(runs["algorithm"] == "TD3ICM") & runs["env"].isin(MAZES)]
    speed = (td3["timesteps"] / td3["seconds"]).median()
    steps = BUDGETS["paper"].timesteps("NSES", US)
    return [
        f"TD3ICM trains one policy at some {round(speed, -2):.0f} steps a second",
        f"{_power(steps, 2)} steps would take {steps / speed / 86_400:.1f} days a run",
    ]


STATEMENTS: dict[str, Callable[[], list[str]]] = {
    "paper.md": of_paper,
    "paper_claims.md": of_claims,
    "paper_choices.md": of_choices,
    "paper_today.md": of_today,
    "reproduce.md": of_reproduce,
    "../README.md": of_readme,
}
"""By page what it says."""


def _share(firsts: Float64) -> str:
    """How many runs found something."""
    return f"{np.isfinite(firsts).sum()} of {len(firsts)}"


def _up(values: Float64, digits: int) -> str:
    """The largest, rounded up."""
    text = f"{np.ceil(np.nanmax(values) * 10**digits) / 10**digits:.{digits}f}"
    return text.removeprefix("0")


def _thousands(value: float) -> str:
    return f"{round(value, -3):,.0f}"


def _power(value: float, digits: int) -> str:
    """1.12e7; 2e5."""
    figures, exponent = f"{value:.{digits}e}".split("e")
    return f"{figures}e{int(exponent)}"
