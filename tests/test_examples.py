"""Every example and every Python snippet of the documentation runs, in `make docs`."""

import re

import pytest
from scripts import ROOT, cut_budgets, run_script

ARGUMENTS = {
    "check_bonus.py": ["--updates", "100"],
    "control_task.py": ["--timesteps", "1e4"],
    "custom_maze.py": ["--timesteps", "1e4"],
    "plain_gymnasium_loop.py": [],
    "ray_cluster.py": ["--timesteps", "1e4", "--workers", "1"],
    "quality_diversity.py": ["--timesteps", "2e5", "--target", "60", "40"],
}
NEEDS = {"ale_py": ("ale_py", "cv2"), "envpool": ("envpool",), "minigrid": ("minigrid",)}
"""Of a page that imports the first, what must be there, as it is no dependency."""
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def snippets(page):
    """The page's Python blocks, their budgets cut."""
    blocks = re.findall(r"^```python\n(.*?)^```", page.read_text(), flags=re.M | re.S)
    return [cut_budgets(block) for block in blocks]


def test_every_example_is_here():
    names = {path.name for path in (ROOT / "examples").glob("*.py")}
    elsewhere = {"rl_zoo3_train.py", "rl_zoo3_spaces.py"}  # run in test_rl_zoo3.py
    assert names == {*ARGUMENTS, *elsewhere, "train_curiosity_es.py"}


@pytest.mark.pages
@pytest.mark.parametrize("name", sorted(ARGUMENTS))
def test_example(name, tmp_path):
    assert run_script(ROOT / "examples" / name, tmp_path, ARGUMENTS[name]).strip()


@pytest.mark.pages
def test_training_example_writes_its_report(tmp_path):
    arguments = ["--env", "CuriosityMaze-US-v0", "--timesteps", "2e5", "--out", "report"]
    printed = run_script(ROOT / "examples" / "train_curiosity_es.py", tmp_path, arguments)
    names = {path.name for path in (tmp_path / "report").iterdir()}
    pictures = {"final_positions.png", "coverage_and_return.png", "best_policy.gif"}
    assert names == {"model.zip", "progress.csv", *pictures}
    assert "The goal was not reached." in printed or "First reward after" in printed
    assert re.search(r"Coverage: \d+\.\d% of the reachable cells", printed)


@pytest.mark.pages
@pytest.mark.parametrize(
    "program", [pytest.param("\n".join(snippets(p)), id=p.name) for p in PAGES if snippets(p)]
)
def test_snippets_of_a_page_run_in_their_order(program, tmp_path):
    if "RepeatAction" in program:
        pytest.importorskip("gymnasium", minversion="1.3")
    for name in (each for key, needed in NEEDS.items() if key in program for each in needed):
        pytest.importorskip(name)
    # With a guard, as snippets with subprocesses would otherwise start themselves again.
    lines = program.splitlines()
    script = tmp_path / "snippets.py"
    script.write_text("if __name__ == '__main__':\n" + "".join(f"    {line}\n" for line in lines))
    run_script(script, tmp_path)
