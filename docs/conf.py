"""Settings of Sphinx: `sphinx-build -W docs docs/_build/html` makes the site of this folder."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as installed
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
from extensions.declared import substitutions

os.environ.setdefault("NUMBA_NUM_THREADS", "1")

project = "imubench_pipeline"
author = copyright = "The imubench_pipeline developers"
release = version = installed(project)

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "extensions.docstrings",
    "extensions.generated",
    "extensions.mathml",
]
exclude_patterns = ["_build"]
nitpicky = False
suppress_warnings = [
    "ref.python",  # a type of a docstring that several modules have
    "myst-nb.lexer",  # a notebook that is not run does not say in what language it is
]

myst_enable_extensions = ["dollarmath", "colon_fence", "deflist", "substitution"]
myst_substitutions = substitutions()
myst_heading_anchors = 4
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 120
nb_merge_streams = True

toc_object_entries = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"
default_role = "code"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True

html_theme = "furo"
html_title = f"imubench {release}"
html_math_renderer = "mathml"
html_copy_source = False
html_show_sphinx = False
