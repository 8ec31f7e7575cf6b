"""What makes a wheel with compiled kernels: only if the environment variable ASSOC_KERNELS names their folder.

``make dist`` sets it. Without it (``pip install .``, the sdist) the wheel holds Python alone and fits everywhere.
"""

import os
import sys
import sysconfig
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class CustomBuildHook(BuildHookInterface):
    """Adds the kernels, and says for which Python and which system they are."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Change what the wheel holds and how it is named."""
        folder = os.environ.get("ASSOC_KERNELS")
        if not folder or version == "editable":
            return
        python = f"cp{sys.version_info.major}{sys.version_info.minor}"
        system = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        # nothing in it is linked against a C library: what loads the kernels is numba, and its wheels ask for this much
        system = system.replace("linux_", "manylinux_2_17_")
        build_data["pure_python"] = False
        build_data["tag"] = f"{python}-{python}-{system}"
        build_data["force_include"][os.path.abspath(folder)] = "assoc/_kernels"
