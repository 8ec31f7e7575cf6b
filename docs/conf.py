"""Sphinx configuration: `make docs`."""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
# tutorials run in kernels of their own: they must find this tree too
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))

import assoc  # noqa: E402

project = "assoc"
author = copyright = "The assoc developers"
version = release = assoc.__version__

extensions = ["sphinx.ext.autodoc", "numpydoc", "myst_nb"]
exclude_patterns = ["_build", "_tables"]
nitpicky = False

html_theme = "furo"
html_title = f"assoc {release}"
html_show_sphinx = False
html_static_path = ["_static"]
html_css_files = ["tables.css"]
html_theme_options = {"navigation_with_keys": True}

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3

# tutorials are executed at every build, and an error in one fails the build
nb_execution_mode = "force"
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_output_stderr = "remove-warn"

autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
# an extra that is not installed takes only its own details from the page
OPTIONAL = ("stonesoup", "ordered_set", "matplotlib", "plotly", "optuna", "distributed")
autodoc_mock_imports = [name for name in OPTIONAL if not find_spec(name)]


def list_parameters(app, what, name, obj, options, lines):
    """Parameters of solvers are described once, by the help texts of their fields."""
    own = vars(obj).get("__annotations__", {}) if what == "class" else ()
    described = [(one, obj.__dataclass_fields__[one]) for one in own if one in getattr(obj, "__dataclass_fields__", {})]
    for one, field in described:
        if text := field.metadata.get("help"):
            lines += [f"- ``{one}`` ({field.default!r}): {text}"]


def setup(app):
    """Let docstrings be completed."""
    app.connect("autodoc-process-docstring", list_parameters)
