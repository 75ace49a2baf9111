"""The tutorials, which are Markdown, as notebooks beside their pages."""

import base64
import mimetypes
import re
from functools import partial
from pathlib import Path
from typing import Any

import jupytext
from sphinx.application import Sphinx

FOLDER = "tutorials"
PICTURE = re.compile(r"(?<=\]\()(?!https?:)[^)]+\.(?:png|gif)(?=\))")
LINK = '\n\n<a href="{name}.ipynb" download>Download this page as a notebook</a>'


def setup(app: Sphinx) -> dict[str, Any]:
    """Write the notebooks when the site is built, and link them below the pages' titles."""
    app.connect("builder-inited", write)
    app.connect("source-read", link)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def pages(folder: Path) -> list[Path]:
    """The pages that are notebooks."""
    return sorted(page for page in folder.glob("*.md") if page.stem != "index")


def write(app: Sphinx) -> None:
    """Write a notebook for each page: pictures are in it, outputs and links to pages are not."""
    folder = Path(app.outdir) / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for page in pages(Path(app.srcdir) / FOLDER):
        notebook = jupytext.read(page)
        for cell in notebook.cells:
            if cell.cell_type == "markdown":
                text = PICTURE.sub(partial(embedded, page.parent), cell.source)
                cell.source = re.sub(r"\[([^]]+)\]\((?!https?:|data:)[^)]+\)", r"\1", text)
        jupytext.write(notebook, folder / f"{page.stem}.ipynb")


def embedded(folder: Path, address: re.Match[str]) -> str:
    """An address that is the picture itself."""
    path = folder / address[0]
    kind, _ = mimetypes.guess_type(path)
    return f"data:{kind};base64,{base64.b64encode(path.read_bytes()).decode()}"


def link(app: Sphinx, name: str, source: list[str]) -> None:
    """Put the link of the notebook below the title of its page."""
    folder, _, page = name.rpartition("/")
    if folder == FOLDER and page != "index":
        below_title = re.compile(r"^# .+$", re.MULTILINE)
        source[0] = below_title.sub(rf"\g<0>{LINK.format(name=page)}", source[0], count=1)
