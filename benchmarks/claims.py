"""What the paper says of algorithms, in our words, and what would show it.

`python -m benchmarks.claims` prints the verdicts, and with `--check` it compares the prose of the
pages with the committed runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import typer

from benchmarks import prose
from benchmarks.judging import (
    Judge,
    ahead,
    all_of,
    as_good,
    at_least,
    below,
    finds,
    finds_none,
    nearly_as_good,
    not_measured,
    opposite,
)
from benchmarks.paper import SETTINGS, evidence
from benchmarks.plan import (
    BOTTLENECK,
    COMPARED,
    CONTROL,
    MAZES,
    exploring,
)
from benchmarks.run_numbers import DRAWN, N_POLICIES, US

SNAKE, _, HARD = MAZES
BALL, FINGER, STACKER = CONTROL
ALL = (*MAZES, *CONTROL)
OTHERS = COMPARED[1:]
EVERY_OTHER = (*OTHERS, "NSLC", "AURORA")


@dataclass(frozen=True)
class Claim:
    """A sentence of the paper.

    Args:
        section: Its number in the paper.
        text: In our words.
        judge: Says whether it holds.
    """

    section: str
    text: str
    judge: Judge


def _explores(x: str, y: str, *envs: str, **settings: str) -> Judge:
    """That `x` covers more than `y` with settings; in control tasks neither regards reward."""
    return all_of(
        *(ahead("coverage", exploring(x, env), exploring(y, env, **settings), env) for env in envs)
    )


def _explores_as_much(x: str, y: str, *envs: str) -> Judge:
    """The same, or as much: up to a tenth."""
    return all_of(
        *(nearly_as_good("coverage", exploring(x, env), exploring(y, env), env) for env in envs)
    )


_SAID: dict[str, dict[str, Judge]] = {
    "abstract": {
        f"Curiosity-ES finds more rewarding policies than {other}.": ahead(
            "rewarding policies", "CuriosityES", other, *ALL
        )
        for other in EVERY_OTHER
    },
    "4.4": {
        f"Curiosity-ES covers more than {other}.": _explores("CuriosityES", other, *ALL)
        for other in EVERY_OTHER
    },
    "5": {
        "Curiosity-ES finds a reward in all six environments.": finds("CuriosityES", *ALL),
        **{
            f"Policies of Curiosity-ES are as efficient as those of {other}, or more.": as_good(
                "best return", "CuriosityES", other, 0.02, *ALL
            )
            for other in OTHERS
        },
    },
    "5.1": {
        "NS-ES finds the goals of all mazes.": finds("NSES", *MAZES),
        "NS-ES finds them early: within a fifth of the budget.": below(
            "share of the budget", "NSES", 0.2, *MAZES
        ),
        "The policies of NS-ES reach a plateau: less than .01 is gained in the second "
        "half.": all_of(finds("NSES", *MAZES), below("late gain", "NSES", 0.01, *MAZES)),
        "Curiosity-ES improves throughout: .01 or more is gained in the second half.": all_of(
            finds("CuriosityES", *MAZES), at_least("late gain", "CuriosityES", 0.01, *MAZES)
        ),
        "Curiosity-ES gains more in that half than NS-ES.": all_of(
            finds("CuriosityES", *MAZES), ahead("late gain", "CuriosityES", "NSES", *MAZES)
        ),
        "CMA-ME finds the goal of US.": finds("CMAME", US),
        "CMA-ME finds no other goal.": finds_none("CMAME", SNAKE, HARD),
        "MAP-Elites finds the goals of Snake and US.": finds("MAPElites", SNAKE, US),
        "MAP-Elites does not find that of Hard.": finds_none("MAPElites", HARD),
        **{
            f"{name} is more efficient than {other} in US.": ahead("best return", name, other, US)
            for name, other in (("MAPElites", "NSES"), ("CMAME", "NSES"), ("CMAME", "MAPElites"))
        },
        "Curiosity-ES comes to the efficiency of CMA-ME in US.": as_good(
            "best return", "CuriosityES", "CMAME", 0.02, US
        ),
        "TD3-ICM finds the goal of US.": finds("TD3ICM", US),
        "TD3-ICM finds no other goal.": finds_none("TD3ICM", SNAKE, HARD),
        "TD3-ICM loses what it found in US: its last episodes are .1 or more below its "
        "best.": all_of(finds("TD3ICM", US), at_least("decline", "TD3ICM", 0.1, US)),
        "The ICM learns faster than TD3 explores: in the second half its reward is small and "
        "constant, below a tenth of what it was.": below("bonus left", "TD3ICM", 0.1, *MAZES),
        "Curiosity-ES reaches almost all terminal states of the mazes: 90 % or more.": at_least(
            "coverage", "CuriosityES", 0.9, *MAZES
        ),
        "Curiosity-ES continually explores: it covers .01 or more of the mazes in the second half "
        "of the steps.": at_least("late coverage", "CuriosityES", 0.01, *MAZES),
        "MAP-Elites covers less than Curiosity-ES in every maze.": ahead(
            "coverage", "CuriosityES", "MAPElites", *MAZES
        ),
        "CMA-ME covers less than Curiosity-ES in Snake and Hard.": ahead(
            "coverage", "CuriosityES", "CMAME", SNAKE, HARD
        ),
        "CMA-ME covers as much as Curiosity-ES in US, up to .05.": as_good(
            "coverage", "CMAME", "CuriosityES", 0.05, US
        ),
        **{
            f"Final states of NS-ES are more even than those of {other}.": ahead(
                "evenness", "NSES", other, *MAZES
            )
            for other in ("CMAME", "CuriosityES")
        },
        "CMA-ME has fewer final states near the goals of Snake and Hard than Curiosity-ES.": ahead(
            "share near the goal", "CuriosityES", "CMAME", SNAKE, HARD
        ),
        "Few episodes of Curiosity-ES end in the middle of Snake: fewer than if places were "
        "equal, and the goal is found.": all_of(
            finds("CuriosityES", SNAKE), below("density in the middle", "CuriosityES", 1.0, SNAKE)
        ),
        "Corridors of US that are like others are explored less by Curiosity-ES.": not_measured(
            "the paper does not say which these are; see figure 4"
        ),
        "Curiosity-ES has more final states near the goals of all mazes than NS-ES.": ahead(
            "share near the goal", "CuriosityES", "NSES", *MAZES
        ),
        "Where there is one way, in Snake and Hard, a motivation is needed: NS-ES covers more than "
        "MAP-Elites.": ahead("coverage", "NSES", "MAPElites", SNAKE, HARD),
        "Where there are many, in US, MAP-Elites covers as much as NS-ES, up to .05.": as_good(
            "coverage", "MAPElites", "NSES", 0.05, US
        ),
    },
    "5.2": {
        "Curiosity-ES finds a reward in all control tasks.": finds("CuriosityES", *CONTROL),
        "MAP-Elites finds a reward in all control tasks.": finds("MAPElites", *CONTROL),
        "CMA-ME finds none in any of them.": finds_none("CMAME", *CONTROL),
        "NS-ES finds those of Stacker and Finger.": finds("NSES", STACKER, FINGER),
        "NS-ES does not find that of BallInCup.": finds_none("NSES", BALL),
        "NS-ES diverges in Finger: its last generations are .1 or more below its best.": all_of(
            finds("NSES", FINGER), at_least("decline", "NSES", 0.1, FINGER)
        ),
        "TD3-ICM finds that of BallInCup.": finds("TD3ICM", BALL),
        "TD3-ICM finds no other.": finds_none("TD3ICM", FINGER, STACKER),
        "TD3-ICM improves throughout in BallInCup: .01 or more is gained in the second "
        "half.": all_of(finds("TD3ICM", BALL), at_least("late gain", "TD3ICM", 0.01, BALL)),
        **{
            f"Without reward Curiosity-ES explores more of all control tasks than "
            f"{other}.": _explores("CuriosityES", other, *CONTROL)
            for other in ("NSES", "CMAME", "TD3ICM")
        },
        "Without reward Curiosity-ES explores more of BallInCup and Finger than "
        "MAP-Elites.": _explores("CuriosityES", "MAPElites", BALL, FINGER),
        "MAP-Elites explores as much of Stacker as Curiosity-ES, up to a tenth.": _explores_as_much(
            "MAPElites", "CuriosityES", STACKER
        ),
        **{
            f"With reward (`phi=0.8`), too, it explores more than {other}.": ahead(
                "coverage", "CuriosityES", other, *CONTROL
            )
            for other in ("NSES", "CMAME", "TD3ICM")
        },
        "MAP-Elites explores more of each control task than CMA-ME.": ahead(
            "coverage", "MAPElites", "CMAME", *CONTROL
        ),
        "Curiosity-ES finds more efficient policies than NS-ES in all environments.": ahead(
            "best return", "CuriosityES", "NSES", *ALL
        ),
    },
    "5.3": {
        "NS-ES explores more than NSLC in Snake, US and Finger.": _explores(
            "NSES", "NSLC", *BOTTLENECK
        ),
        "In the other three, too.": _explores("NSES", "NSLC", HARD, BALL, STACKER),
        "NSLC explores less than MAP-Elites everywhere.": _explores("MAPElites", "NSLC", *ALL),
        "NSLC finds no reward anywhere.": finds_none("NSLC", *ALL),
        "AURORA finds no reward anywhere.": finds_none("AURORA", *ALL),
        "AURORA takes longer than Curiosity-ES.": ahead("seconds", "AURORA", "CuriosityES", *MAZES),
        **{
            f"With the whole state as behavior {name} explores less.": _explores(
                name, name, *BOTTLENECK, behavior="state"
            )
            for name in ("NSES", "NSLC")
        },
        "This is less pronounced for NSLC than for NS-ES.": all_of(
            *(
                ahead("coverage lost", exploring("NSES", env), exploring("NSLC", env), env)
                for env in BOTTLENECK
            )
        ),
        "Curiosity-ES, which knows no behavior, explores as much as NS-ES, up to a tenth, "
        "or more.": _explores_as_much("CuriosityES", "NSES", *BOTTLENECK),
    },
    "6": {
        "CMA-ME and Curiosity-ES cover nearly all of US: 90 % or more.": all_of(
            *(at_least("coverage", name, 0.9, US) for name in ("CMAME", "CuriosityES"))
        ),
        "MAP-Elites finds few distinct rewarding policies in US: fewer than CMA-ME.": ahead(
            f"routes of {N_POLICIES}", "CMAME", "MAPElites", US
        ),
        "Rewarding policies of CMA-ME are far from each other: Curiosity-ES has nearer "
        "neighbors.": opposite(ahead("nearest distance", "CuriosityES", "CMAME", US)),
        **{
            f"Rewarding policies of Curiosity-ES are in more regions of the projection than those "
            f"of {other}.": ahead("regions", "CuriosityES", other, US)
            for other in ("MAPElites", "CMAME")
        },
        **{
            f"Curiosity-ES covers the areas that {other} found: nine tenths of its "
            "regions.": at_least(f"share of {other}'s regions", "CuriosityES", 0.9, US)
            for other in DRAWN
        },
        **{
            f"Curiosity-ES finds more rewarding policies in US than {other}.": ahead(
                "rewarding policies", "CuriosityES", other, US
            )
            for other in ("MAPElites", "CMAME")
        },
        "Highly rewarding ones, of .5 or more, are in more regions than those of CMA-ME.": ahead(
            "regions of .5 or more", "CuriosityES", "CMAME", US
        ),
    },
}
"""By section what it says, and what judges that."""
CLAIMS = [
    Claim(section, text, judge) for section, said in _SAID.items() for text, judge in said.items()
]


def main(
    check: Annotated[bool, typer.Option("--check", help="Compare the pages' prose.")] = False,
) -> None:
    """Print the verdicts, or what a page says otherwise than the data, and fail then."""
    if not check:
        for settings in SETTINGS:
            tables = evidence(settings)
            for claim in CLAIMS:
                print(f"{settings}, {claim.section}: {claim.text} *{claim.judge(tables).word}*")
        return
    faults = [f"{page}: {fault}" for page in prose.STATEMENTS for fault in prose.faults(page)]
    print("\n".join(faults) or "The pages say what the data say.")
    raise typer.Exit(bool(faults))


if __name__ == "__main__":
    typer.run(main)
