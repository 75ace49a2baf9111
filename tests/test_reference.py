"""The reference says of every public name and argument what it is, and of nothing else."""

import ast
import inspect
import re
from functools import cached_property
from importlib import import_module
from itertools import pairwise
from pathlib import Path

import curiosity_algos
import curiosity_gym

DOCS = Path(__file__).parents[1] / "docs"
DIRECTIVE = re.compile(r"^\.\. (auto\w+|currentmodule):: (\S+)\n((?: +:.*\n)*)", re.MULTILINE)
HEADINGS = ("Args:", "Attributes:")


def resolve(path):
    """The object of a dotted path."""
    module, names = path, []
    while True:
        try:
            found = import_module(module)
            break
        except ImportError:
            module, _, name = module.rpartition(".")
            names.insert(0, name)
    for name in names:
        found = getattr(found, name)
    return found


def documented():
    """Every object of the reference with its members, by the path that a page says it by."""
    found = {}
    for page in [*sorted(DOCS.glob("*.md")), *sorted(DOCS.glob("*/*.md"))]:
        module = ""
        for kind, path, options in DIRECTIVE.findall(page.read_text()):
            if kind == "currentmodule":
                module = path
            elif kind != "autosummary":
                path = path if path.startswith("curiosity") else f"{module}.{path}"
                found[path] = resolve(path)
                found |= members(path, found[path], options)
    return {path: each for path, each in found.items() if not inspect.ismodule(each)}


def members(path, owner, options):
    """Those members of a class or module that a directive shows."""
    shown = re.search(r":members:(.*)", options)
    if shown is None:
        return {}
    names = [each.strip() for each in shown[1].split(",") if each.strip()]
    if not names:
        names = [name for name, each in vars(owner).items() if is_public(name, each, owner)]
    return {f"{path}.{name}": inspect.getattr_static(owner, name) for name in names}


def is_public(name, member, owner):
    is_own = not inspect.ismodule(owner) or getattr(member, "__module__", None) == owner.__name__
    kinds = (
        inspect.isfunction(member)
        or inspect.isclass(member)
        or isinstance(member, property | cached_property)
    )
    return not name.startswith("_") and is_own and kinds


def described(docstring, headings=HEADINGS):
    """The names that a docstring's sections of arguments and attributes describe."""
    names, inside = set(), False
    for line in inspect.cleandoc(docstring).splitlines():
        if not line.startswith(" ") and line:
            inside = line in headings
        elif inside and (match := re.match(r" {4}(\*{0,2}\w+)(?: \(.*\))?: ", line)):
            names.add(match[1].lstrip("*"))
    return names


def described_with_parents(each):
    """The names that a docstring describes, of a class also those that its parents' do.

    Of an algorithm of Stable-Baselines3's also those of that.
    """
    classes = list(inspect.getmro(each)) if inspect.isclass(each) else [each]
    known = [parent for parent in classes if parent is each or parent in REFERENCE.values()]
    of_sb3 = [parent for parent in classes if parent.__module__.startswith("stable_baselines3")]
    names = re.findall(r":param (\w+):", "".join(inspect.getdoc(parent) or "" for parent in of_sb3))
    return set(names).union(*(described(inspect.getdoc(parent)) for parent in known))


def arguments(each):
    """The names of the arguments that a user may give, but those that are passed on."""
    passed_on = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD
    each = getattr(each, "__func__", each)
    given = () if isinstance(each, property) else inspect.signature(each).parameters.values()
    names = {each.name for each in given if each.kind not in passed_on}
    return {name for name in names - {"self", "cls"} if not name.startswith("_")}


REFERENCE = documented()
TAKERS = {
    path: each
    for path, each in REFERENCE.items()
    if (inspect.isclass(each) and not issubclass(each, Exception)) or "Args:" in f"{each.__doc__}"
}
"""Of which arguments must be described: classes, and functions that describe any."""


def test_every_public_name_is_there():
    shown = {id(each) for each in REFERENCE.values()}
    for package in (curiosity_algos, curiosity_gym):
        names = {f"{package.__name__}.{name}" for name in package.__all__}
        assert {name for name in names if id(resolve(name)) not in shown} == set()


def test_everything_shown_says_what_it_is():
    assert [path for path, each in REFERENCE.items() if not inspect.getdoc(each)] == []


def test_all_arguments_are_described_and_no_others():
    for path, each in TAKERS.items():
        taker = getattr(each, "__func__", each)
        given = () if isinstance(taker, property) else inspect.signature(taker).parameters
        assert arguments(each) <= described_with_parents(each), path
        assert described(inspect.getdoc(taker), ["Args:"]) <= set(given), path


def bodies():
    """The statements of classes of the reference, of their parents, and of modules shown whole."""
    pages = "".join(page.read_text() for page in DOCS.rglob("*.md"))
    for name in re.findall(r"^\.\. automodule:: (\S+)", pages, re.MULTILINE):
        yield ast.parse(inspect.getsource(import_module(name))).body
    classes = filter(inspect.isclass, REFERENCE.values())
    for each in set().union(*map(inspect.getmro, classes)):
        if each.__module__.startswith("curiosity"):
            yield ast.parse(inspect.getsource(each)).body[0].body


def read_for_types():
    """The first lines of properties, of attributes, and of what is returned."""
    for before, here in (pair for body in bodies() for pair in pairwise(body)):
        if isinstance(here, ast.FunctionDef):
            text = ast.get_docstring(here) or ""
            decorators = {ast.unparse(each) for each in here.decorator_list}
            is_property = not decorators.isdisjoint({"property", "cached_property"})
            yield from [text] if is_property else re.findall(r"^Returns:\n(.*)", text, re.MULTILINE)
        elif isinstance(before, ast.Assign | ast.AnnAssign) and isinstance(here, ast.Expr):
            yield here.value.value


def test_no_words_are_taken_for_a_type():
    """Napoleon takes those before a colon in such a line."""
    lines = [text.partition("\n")[0] for text in read_for_types()]
    assert len(lines) > 50
    assert [line for line in lines if ":" in re.sub(r"`[^`]*`|::", "", line)] == []
