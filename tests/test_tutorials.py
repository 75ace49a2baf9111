"""Every tutorial is a notebook that can be downloaded; `make docs` runs them."""

import json
import re
from types import SimpleNamespace

from scripts import ROOT

from docs.notebooks import link, pages, write

DOCS = ROOT / "docs"
PAGES = {page.stem: page for page in pages(DOCS / "tutorials")}


def test_every_tutorial_is_listed():
    index = (DOCS / "tutorials" / "index.md").read_text()
    tree = index.split("```{toctree}")[1].split()
    assert tree[1:-1] == [each for each in tree if each in PAGES]
    assert set(tree[1:-1]) == set(PAGES)
    assert all(f"({name}.md)" in index for name in PAGES)


def test_pages_are_written_as_notebooks_and_linked(tmp_path):
    write(SimpleNamespace(srcdir=DOCS, outdir=tmp_path))
    assert {path.stem for path in (tmp_path / "tutorials").iterdir()} == set(PAGES)
    for name, page in PAGES.items():
        notebook = json.loads((tmp_path / "tutorials" / f"{name}.ipynb").read_text())
        code = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
        # No index has the package: a clone's folder, or a file, is installed.
        assert re.search(r'^%pip install --quiet "\.(\[\w+\])?"$', "".join(code[0]["source"]), re.M)
        assert len(code) >= 4
        assert not any(cell["outputs"] for cell in code)
        text = json.dumps(notebook["cells"]).replace("](*", "")
        assert not re.search(r"\]\((?!http|data:image/(png|gif);base64,)", text)
        assert text.count("](data:") == page.read_text().count("](../images/")
        source = [page.read_text()]
        link(None, f"tutorials/{name}", source)
        title = notebook["cells"][0]["source"][0].rstrip()
        assert f'{title}\n\n<a href="{name}.ipynb" download>' in source[0]


def test_other_pages_have_no_notebook():
    for name in ("tutorials/index", "quickstart"):
        source = ["# A title\n"]
        link(None, name, source)
        assert source == ["# A title\n"]
