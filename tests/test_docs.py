"""What the documentation promises of its own pages."""

import ast
import inspect
import re
import tomllib
from importlib.metadata import metadata
from pathlib import Path

import pytest
import yaml
from browser import needs_chromium, run_in_page
from gymnasium.spaces import Box
from latex2mathml.converter import convert

import curiosity_algos
import curiosity_gym
from curiosity_algos import RND
from curiosity_algos.archives.base import EliteArchive
from curiosity_algos.archives.sparse_grid import SparseGridArchive
from curiosity_algos.archives.unstructured import UnstructuredArchive
from curiosity_algos.bonuses.base import NetworkBonus, NetworkKeywords
from curiosity_algos.curiosity.curiosity import CuriosityKeywords
from curiosity_algos.state.settings import HasSettings
from docs.keywords import HANDED_ON, groups, rewrite

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
OWN = DOCS / "write_your_own.md"
ARCHIVES = SparseGridArchive, UnstructuredArchive
KEYWORDS = {
    **dict.fromkeys((NetworkBonus, RND), NetworkKeywords.__annotations__),
    **dict.fromkeys((HasSettings,), CuriosityKeywords.__annotations__),
    EliteArchive: inspect.signature(EliteArchive).parameters.keys() - {"measure_dim"},
}
"""What a class of that base hands on."""
PAGES = sorted(path for path in (DOCS / "algorithms").glob("*.md") if path.stem != "index")


def test_an_algorithms_page_begins_with_an_example_then_its_arguments_and_methods():
    assert len(PAGES) >= 9
    for page in PAGES:
        title, *_ = page.read_text().splitlines()
        algorithm = title.removeprefix("# ")
        assert hasattr(curiosity_algos, algorithm)
        example, arguments = page.read_text().split("\n## ")[1:3]
        assert example.startswith("Example")
        assert f"import {algorithm}\n" in example
        assert arguments.startswith("Arguments and methods")
        assert f".. autoclass:: curiosity_algos.{algorithm}\n" in arguments
        assert "   :members:\n   :inherited-members:\n" in arguments


HANDS_ON = [
    cls
    for cls in (*(getattr(curiosity_algos, name) for name in curiosity_algos.__all__), *ARCHIVES)
    if re.search(r"eywords\s+are\s+those", inspect.getdoc(cls) or "")
]


@pytest.mark.parametrize("cls", HANDS_ON)
def test_the_page_of_a_class_has_all_its_keywords_with_their_defaults(cls):
    page = groups(cls)
    found = re.findall(r"^    (\w+) \((.+)\): \S", "".join(page.values()), re.M)
    names = [name for name, _ in found]
    taken = inspect.signature(cls).parameters.values()
    named = {one.name: one for one in taken if one.kind is not one.VAR_KEYWORD}
    handed_on = named if len(named) == len(taken) else KEYWORDS[cls.__mro__[1]]
    assert len({*names}) == len(names)
    assert {*names} == named.keys() | set(handed_on)
    required = [one.name for one in named.values() if one.kind is one.POSITIONAL_OR_KEYWORD]
    assert names[: len(required)] == required
    for name, kind in found:
        default = named[name].default if name in named else inspect.Parameter.empty
        assert default is inspect.Parameter.empty or kind.endswith(f", default ``{default!r}``")


@pytest.mark.parametrize("cls", HANDS_ON)
def test_what_else_a_docstring_says_stays_in_its_paragraphs(cls):
    lines = inspect.getdoc(cls).split("\n")
    rewrite(None, "class", cls.__name__, cls, None, lines)
    text = "\n".join(lines)
    assert not HANDED_ON.search(text)
    assert not re.search(r"^ {1,3}\S", text, re.M)


def test_keywords_that_a_class_hands_on_have_the_defaults_that_are_in_force():
    assert len(HANDS_ON) >= 20
    buffer = groups(curiosity_algos.BonusReplayBuffer)["Of the bonus"]
    made = curiosity_algos.BonusReplayBuffer(9, Box(-1, 1, (2,)), Box(-1, 1, (1,)))
    for name in ("weight", "norm_reward", "train_interval", "gamma"):
        default = re.search(rf"{name} \(.*, default ``(.+)``\)", buffer)[1]
        assert ast.literal_eval(default) == getattr(made, name)
    bonus = groups(curiosity_algos.NGU)["Of every bonus"]
    assert "learning_rate (``float``, default ``0.001``)" in bonus


@pytest.mark.parametrize("name", ["README.md", "CHANGELOG.md", "CONTRIBUTING.md"])
def test_links_outside_of_the_site_lead_somewhere(name):
    text = re.sub(r"^```.*?^```", "", (ROOT / name).read_text(), flags=re.M | re.S)
    links = [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if "://" not in link]
    assert links or name == "CONTRIBUTING.md"
    for link in links:
        path, _, anchor = link.partition("#")
        target = ROOT / (path or name)
        assert target.exists(), link
        if anchor:
            titles = re.findall(r"^#+ (.+)$", target.read_text(), flags=re.M)
            assert anchor in {slug(title) for title in titles}, link


def test_the_description_on_a_package_index_needs_no_file_beside_it():
    # As the build makes it: an installed one is as old as its installation.
    readme = description = (ROOT / "README.md").read_text()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    hook = project["tool"]["hatch"]["metadata"]["hooks"]["fancy-pypi-readme"]
    assert hook["fragments"] == [{"path": "README.md"}]
    for each in hook["substitutions"]:
        description = re.sub(each["pattern"], each["replacement"], description)
    assert "# Curiosity-driven policy search" in metadata("curiosity-search")["Description"]
    links = re.findall(r"\]\(([^)\s]+)\)", description)
    assert links
    assert all(link.startswith(("https://", "#")) for link in links)
    assert not re.search(r"<img|^\[[^\]]+\]: ", description, flags=re.M)
    code = re.compile(r"^```.*?^```|`[^`\n]+`", flags=re.M | re.S)
    assert code.findall(description) == code.findall(readme)


def slug(title):
    """The anchor of a heading, as GitHub and MyST make it."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def test_every_formula_is_drawn():
    pages = [path.read_text() for path in DOCS.rglob("*.md")]
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", "\n".join(pages), flags=re.M | re.S)
    formulas = re.findall(r"\$\$?([^$]+)\$\$?", text)
    assert len(formulas) > 30
    for formula in formulas:
        drawn = convert(formula)
        assert drawn.startswith("<math")
        assert "\\" not in drawn, formula  # a command that is not known


def test_the_citation_is_of_this_version():
    cited = yaml.safe_load((DOCS.parent / "CITATION.cff").read_text())
    assert cited["version"] == curiosity_gym.__version__


@pytest.mark.parametrize("page", ["README.md", "docs/index.md"])
def test_the_paper_is_linked_and_cited_alike(page):
    text = (ROOT / page).read_text()
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())["preferred-citation"]
    assert project["urls"]["Paper"] == f"https://doi.org/{cited['doi']}"
    assert f"({project['urls']['Paper']})" in text
    (entry,) = re.findall(r"^```bibtex\n@article(.*?)^```", text, flags=re.M | re.S)
    fields = dict(re.findall(r"(\w+) = \{(.*?)\}", " ".join(entry.split())))
    assert all(fields[name] == str(cited[name]) for name in ("title", "journal", "year", "doi"))
    names = [f"{each['family-names']}, {each['given-names']}" for each in cited["authors"]]
    assert fields["author"] == " and ".join(names)
    assert cited["identifiers"][0]["value"] == f"arXiv:{fields['eprint']}"


SPELLED_OUT = {
    "autonomous robots that realize their abilities": "algorithms/index.md",
    "covariance matrix adaptation MAP-Elites": "algorithms/index.md",
    "multi-dimensional archive of phenotypic elites": "algorithms/index.md",
    "novelty search with local competition": "algorithms/index.md",
    "twin delayed deep deterministic policy gradient": "algorithms/index.md",
    "active pre-training": "bonuses.md",
    "exploration by elliptical episodic bonuses": "bonuses.md",
    "intrinsic curiosity module": "bonuses.md",
    "never give up": "bonuses.md",
    "novelty difference": "bonuses.md",
    "random network distillation": "bonuses.md",
    "running away from the past": "bonuses.md",
    "proximal policy optimization": "glossary.md",
    "soft actor-critic": "glossary.md",
    "deep Q-network": "glossary.md",
}
"""Names that classes shorten, and the page that introduces them; the README does, too."""


@pytest.mark.parametrize("name", SPELLED_OUT)
def test_names_are_spelled_out_where_they_are_introduced(name):
    for page in (ROOT / "README.md", DOCS / SPELLED_OUT[name]):
        assert name in " ".join(page.read_text().split())


def test_where_it_fails_is_linked_from_the_first_pages():
    for page in (ROOT / "README.md", DOCS / "index.md"):
        assert "where_it_fails.md)" in page.read_text()


def test_what_one_writes_oneself_is_short():
    blocks = re.findall(r"^```python\n(.*?)^```", OWN.read_text(), flags=re.M | re.S)
    assert len(blocks) >= 5
    assert max(len(block.splitlines()) for block in blocks) <= 60


def test_code_is_no_wider_than_its_page():
    """So many characters fit beside both sidebars in a window of 1,300 pixels."""
    block = re.compile(r"^```(?:\w+|\{code-cell\}[^\n]*)\n(.*?)^```", flags=re.M | re.S)
    pages = [ROOT / "README.md", *DOCS.rglob("*.md")]
    lines = "".join(block.findall("\n".join(page.read_text() for page in pages))).splitlines()
    assert len(lines) > 1000
    assert [line for line in lines if len(line) > 90] == []


TABLES = """<!doctype html><html><head><meta name="viewport" content="width=device-width">
<style>{style}</style></head><body>
<div><table class="docutils"><thead><tr><th><p>a</p></th><th><p>b</p></th></tr></thead>
<tbody><tr><td><p>1</p></td><td><p>2</p></td></tr></tbody></table></div>
<div><table class="docutils"><thead><tr>{names}</tr></thead>
<tbody><tr>{values}</tr></tbody></table></div><script>{script}</script></body></html>"""
DEALT = """
addEventListener("load", () => {
  const tables = [...document.querySelectorAll("table")];
  const cell = tables[1].tBodies[0].rows[0].cells[8];
  document.body.dataset.said = JSON.stringify([
    ...tables.map((table) => table.classList.contains("cards")),
    cell.dataset.column, cell.getAttribute("role"),
    cell.getBoundingClientRect().right <= innerWidth ]);
});
"""


@needs_chromium
@pytest.mark.parametrize(("width", "is_narrow"), [(500, True), (700, True), (1300, False)])
def test_a_table_that_would_be_cut_becomes_cards(width, is_narrow, tmp_path):
    page = tmp_path / "page.html"
    text = TABLES.format(
        style=(DOCS / "_static" / "site.css").read_text(),
        script=(DOCS / "_static" / "cards.js").read_text(),
        names="".join(f"<th><p>wide_column_{i}</p></th>" for i in range(9)),
        values="".join(f"<td><p>{i}</p></td>" for i in range(9)),
    )
    page.write_text(text)
    assert run_in_page(page, DEALT, width) == [False, is_narrow, "wide_column_8", "cell", True]
