"""How the benchmarks measure: interleaved repeats, medians with their spread, Markdown tables."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from statistics import median
from typing import Any, TypeVar

Figures = Sequence[float]
Task = Callable[[], float]

_N = TypeVar("_N", int, float)


@dataclass(frozen=True)
class Plan:
    """How much to measure.

    Attributes:
        repeats: Times that each figure is taken.
        quick: Whether the figures only show that the benchmark runs.
    """

    repeats: int
    quick: bool = False

    def size(self, full: _N, quick: _N) -> _N:
        """A workload's size, which depends on `quick`."""
        return quick if self.quick else full


@dataclass(frozen=True)
class Row:
    """One quantity: its figures, one a repeat, and the target that it should meet.

    Attributes:
        of_roof: Where arithmetic bounds it, the share of what the machine could do at most, one a
            repeat; the table says what that is.
    """

    name: str
    figures: Figures
    unit: str
    target: str = ""
    of_roof: Figures = field(default_factory=list)

    def cells(self) -> list[str]:
        """Median, spread, unit, target and share of the roof, as a line of a table has them."""
        low, high = number(min(self.figures)), number(max(self.figures))
        share = f"{number(100.0 * median(self.of_roof))} %" if self.of_roof else ""
        middle = number(median(self.figures))
        return [self.name, middle, f"{low} to {high}", self.unit, self.target, share]


@dataclass(frozen=True)
class Table:
    """A title, rows, and what a reader must know about them."""

    title: str
    rows: list[Row]
    notes: list[str] = field(default_factory=list)

    def markdown(self, level: int = 2) -> str:
        """The table, its title above as a heading of that level, its notes below."""
        n = 6 if any(row.of_roof for row in self.rows) else 5
        head = ["What", "Median", "Spread", "Unit", "Target", "Of the roof"]
        cells = [line[:n] for line in [head, *map(Row.cells, self.rows)]]
        names, *rows = (f"| {' | '.join(line)} |" for line in cells)
        ruler = "|---|--:|--:|---|---|" + "--:|" * (n - 5)
        lines = [f"{'#' * level} {self.title}", "", names, ruler, *rows]
        return "\n".join([*lines, *(f"\n{note}" for note in self.notes), ""])


def markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table: its header, then a line for each row."""
    lines = [columns, ["---"] * len(columns), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def number(value: float) -> str:
    """Three significant digits, never an exponent: 1,234 or 12.3 or 0.00123."""
    if abs(value) >= 100.0:
        return f"{value:,.0f}"
    text = f"{value:#.3g}"
    return (f"{value:.6f}" if "e" in text else text).rstrip(".")


def interleave(tasks: Mapping[str, Task], repeats: int) -> dict[str, list[float]]:
    """The figures of each task, one a repeat.

    The tasks take turns, every second time backwards: a machine that slows down, or a neighbor that
    wakes up, is felt by all of them.
    """
    figures: dict[str, list[float]] = {name: [] for name in tasks}
    for repeat in range(repeats):
        names = list(tasks)[:: -1 if repeat % 2 else 1]
        for name in names:
            figures[name].append(tasks[name]())
    return figures


def ratios(numerators: Figures, denominators: Figures) -> list[float]:
    """Quotients of figures of the same repeat."""
    return [a / b for a, b in zip(numerators, denominators, strict=True)]


def add_peer(
    tasks: dict[str, Task], notes: list[str], name: str, make_task: Callable[[], Task]
) -> None:
    """Add a peer's task, or a note where its package is not installed."""
    try:
        tasks[name] = make_task()
    except ImportError as error:
        notes.append(f"{name} is left out: the package {error.name} is not installed.")


def seconds(function: Callable[[], object]) -> float:
    """Wall time of one call."""
    began = time.perf_counter()
    function()
    return time.perf_counter() - began


class Stopwatch:
    """Seconds that each stage takes by itself, without the stages within it."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self._inner = [0.0]

    def wrap(self, owner: Any, method: str, stage: str) -> None:
        """Time one object's method as `stage`."""
        function = getattr(owner, method)

        def timed(*args: Any, **kwargs: Any) -> Any:
            self._inner.append(0.0)
            began = time.perf_counter()
            result = function(*args, **kwargs)
            elapsed = time.perf_counter() - began
            self.seconds[stage] += elapsed - self._inner.pop()
            self._inner[-1] += elapsed
            return result

        setattr(owner, method, timed)
