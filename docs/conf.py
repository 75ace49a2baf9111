"""Sphinx configuration: Markdown pages by MyST, the reference by autodoc from Google docstrings."""

import os
import sys
from pathlib import Path

from curiosity_gym import __version__

sys.path.insert(0, str(Path(__file__).parent))  # keywords, mathml, notebooks, play

from keywords import SECTIONS

project = "curiosity-search"
author = "The curiosity authors"
project_copyright = "2026, The curiosity authors"
release = __version__

extensions = [
    "keywords",
    "mathml",
    "myst_nb",
    "notebooks",
    "play",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
]
exclude_patterns = ["_build"]
default_role = "code"  # single backticks in docstrings mean code

myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3

nb_execution_mode = "force"  # what a tutorial shows is what it prints now
nb_execution_timeout = 600
os.environ.setdefault("OMP_NUM_THREADS", "1")  # of tutorials: small batches are slower on several
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_output_stderr = "remove"  # of libraries, about the machine that built the page

autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autosummary_generate = False
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
# The sections of an environment's docstring, as in Gymnasium.
napoleon_custom_sections = [
    "Description",
    "Action Space",
    "Observation Space",
    "Behavior",
    "Rewards",
    "Starting State",
    "Success",
    "Episode End",
    "Information",
    "Version History",
    *SECTIONS,
]

html_math_renderer = "mathml"
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["cards.js"]
html_title = f"{project} {release}"
