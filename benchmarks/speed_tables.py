"""Tables of measured speed: each section's, and what the README says of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from statistics import median

from benchmarks.measure import Table, markdown, number
from benchmarks.record import read_sections
from benchmarks.results import FOLDER

SPEED_FILE = FOLDER / "speed.json"
FIGURE = re.compile(r"\{(.+?) \| (.+?)\}")
_SNAKE, _LOOP = "population: CuriosityMaze-Snake-v0", "python_loop: one environment"
_VECTOR, _LEARN = "vector: CuriosityMaze-Hard-v0", "learn: CuriosityMaze-Hard-v0"
_CUP, _FINGER, _STACKER = (
    f"control: CuriosityControl-{name}-v0" for name in ("BallInCup", "Finger", "Stacker")
)
_POOL = "envpool: a batch of environments"
_START = "cold_start: fresh processes"
HEADLINES = (
    (
        "56 policies in closed loop, one thread",
        f"{{{_SNAKE} | one thread}} M steps/s",
        "Kheperax on this CPU, jitted, snake with 32 lasers: "
        f"{{{_SNAKE} | Kheperax, snake, jitted and vmapped}} M steps/s",
        f"{{{_SNAKE} | one thread over Kheperax}}",
    ),
    (
        "the same, two threads",
        f"{{{_SNAKE} | two threads}} M steps/s",
        "the same",
        f"{{{_SNAKE} | two threads over Kheperax}}",
    ),
    (
        "`gym.make` and `step` in a Python loop",
        f"{{{_LOOP} | CuriosityMaze-Snake-v0}} steps/s",
        f"`PointMaze_UMaze-v3`: {{{_LOOP} | PointMaze_UMaze-v3}} steps/s",
        f"{{{_LOOP} | over PointMaze_UMaze-v3}}",
    ),
    (
        "`make_vec` of 1024, two threads",
        f"{{{_VECTOR} | native, 1024 envs, two threads}} M steps/s",
        f"`SyncVectorEnv` of 64: {{{_VECTOR} | SyncVectorEnv of 64}} M steps/s",
        f"{{{_VECTOR} | native over SyncVectorEnv}}",
    ),
    *(
        (
            f"{name}, 56 policies, one thread",
            f"{{{title} | one thread}} steps/s",
            f"bare physics as dm_control steps it, one thread: {{{title} | bare physics}} steps/s",
            f"{{{title} | one thread over bare physics}}",
        )
        for name, title in {"Ball-in-cup": _CUP, "Finger": _FINGER, "Stacker": _STACKER}.items()
    ),
    (
        "Stacker, 56 policies, two threads",
        f"{{{_STACKER} | all threads}} steps/s",
        f"one env of Shimmy's: {{{_STACKER} | Shimmy's env}} steps/s",
        f"{{{_STACKER} | all threads over Shimmy's env}}",
    ),
    *(
        (
            f"{words}, `make_vec` of 56, two threads",
            f"{{{_POOL} | {name}, here}} steps/s",
            f"EnvPool of 56, two threads: {{{_POOL} | {name}, EnvPool}} steps/s",
            f"{{{_POOL} | {name}, over EnvPool}}",
        )
        for name, words in {
            "BallInCup": "Ball-in-cup",
            **{name: name for name in ("Finger", "HalfCheetah", "Ant", "Humanoid")},
        }.items()
    ),
    ("`CuriosityES(...).learn(1e6)`", f"{{{_LEARN} | CuriosityES, learn(1,000,000)}} s", "", ""),
    (
        "first `import` to first `step`",
        f"{{{_START} | first step of CuriosityMaze-Hard-v0}} s",
        f"`CartPole-v1`: {{{_START} | first step of CartPole-v1}} s",
        "",
    ),
)
"""What the README says of speed: what is measured, here, of a peer, and the ratio."""


def section(name: str) -> str:
    """The tables of a section of `benchmarks.run`, and below them what they were measured on."""
    measured_on, made = read_sections(SPEED_FILE)[name]
    return "\n".join([*map(_table, made), *measured_on])


def _table(table: Table) -> str:
    """Its title without the name of its section, as the page has headings of its own."""
    title = table.title.partition(": ")[2]
    return replace(table, title=title[0].upper() + title[1:]).markdown(level=3)


def summary_of(lines: Sequence[Sequence[str]]) -> str:
    """A table of `filled` lines."""
    return markdown(["", "Here", "Peer in the same run", "Ratio"], filled(lines))


def filled(lines: Sequence[Sequence[str]]) -> list[list[str]]:
    """Lines of cells in which `{title | row}` stands for the median of a row of a section."""
    medians = {
        (table.title, row.name): number(median(row.figures))
        for _, made in read_sections(SPEED_FILE).values()
        for table in made
        for row in table.rows
    }
    return [
        [FIGURE.sub(lambda each: medians[each.groups()], cell) for cell in line] for line in lines
    ]
