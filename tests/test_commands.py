"""Commands that pages name can be given."""

import functools
import importlib
import re
import shlex
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from curiosity_algos.cli import app
from curiosity_algos.experiments import sweep as sweeps

ROOT = Path(__file__).parents[1]
RESULTS = ROOT / "benchmarks/results/README.md"
PAGES = [RESULTS, ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMED = re.compile(r"`((?:python\s+-m\s+benchmarks\.|curiosity )[^`\n]*(?:\n[^`\n]+)?)`")
BLOCK = re.compile(r"^(?:python -m benchmarks\.|curiosity )(?:.*\\\n)*.*$", flags=re.MULTILINE)
PLACEHOLDERS = {"N": "2", "SEED": "0"}
"""Words that stand for numbers; others may be any text."""


def commands(page):
    """The commands of a page, each with the words of its line."""
    text = page.read_text()
    blocks = re.findall(r"^```(?:bash|console|sh)\n(.*?)^```", text, flags=re.M | re.S)
    found = NAMED.findall(re.sub(r"^```.*?^```", "", text, flags=re.M | re.S))
    found += [command for block in blocks for command in BLOCK.findall(block)]
    return sorted({" ".join(each.replace("\\\n", " ").split()) for each in found})


def idle(function):
    """A command that takes what another takes, and does nothing."""

    @functools.wraps(function)
    def nothing(*args, **kwargs):
        return

    return nothing


def fault(command):
    """What is wrong with a command; "" if it can be given."""
    _, *words = (PLACEHOLDERS.get(word, word) for word in shlex.split(command, comments=True))
    made = typer.Typer()
    if command.startswith("curiosity"):
        known = app
    else:
        _, module, *words = words
        known = importlib.import_module(module)
    if not isinstance(known, typer.Typer) and not hasattr(known, "app"):
        made.command()(idle(known.main))
    else:
        for info in getattr(known, "app", known).registered_commands:
            made.command(info.name)(idle(info.callback))
    result = CliRunner().invoke(made, words)
    if result.exit_code:
        return f"{result.output} {result.exception!r}"
    known_names = getattr(known, "RUNS", getattr(known, "SWEEPS", None))
    if (
        isinstance(known_names, dict)
        and words
        and not words[0].startswith("-")
        and words[0] not in known_names
    ):
        return f"{words[0]} is not one of {', '.join(known_names)}."
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_of_pages_can_be_given(page):
    given = [each for each in commands(page) if each.count(" ") > 1 and "..." not in each]
    assert {each: said for each in given if (said := fault(each))} == {}


def test_pages_name_many_commands():
    """Those that are broken over a line among them."""
    named = {page.name: commands(page) for page in PAGES}
    assert sum(map(len, named.values())) > 100
    assert "python -m benchmarks.dynamics" in named["paper_choices.md"]


@pytest.mark.parametrize(
    "wrong",
    [
        "curiosity sweep --alogs nses",
        "python -m benchmarks.kept recipe --episode 3",
        "python -m benchmarks.paper colect runs",
        "python -m benchmarks.reasons",
        "python -m benchmarks.learning maze",
    ],
)
def test_a_command_with_a_mistake_is_found(wrong):
    assert fault(wrong)


@pytest.mark.nightly
def test_the_runs_of_the_paper_can_be_trained(monkeypatch):
    """Their models can be made: no keyword and no name is wrong."""
    of_paper = [each for each in commands(RESULTS) if each.startswith("curiosity sweep")]
    assert len(of_paper) > 20
    trained = []
    monkeypatch.setattr(sweeps, "sweep", lambda runs, *args, **kwargs: trained.extend(runs))
    for command in of_paper:
        if "--device cuda" in command:
            continue
        words = re.sub(r"--seeds \S+", "--seeds 0", command)
        result = CliRunner().invoke(app, [*shlex.split(words)[1:], "--jobs", "1"])
        assert result.exit_code == 0, f"{command}: {result.output}{result.exception}"
    assert {run.algorithm for run in trained} >= {"CuriosityES", "TD3ICM", "AURORA"}
