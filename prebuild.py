"""Build hook: with NAMLCP_PREBUILD=1 the wheel holds the machine code of every kernel.

Without that variable it does nothing, and the wheel is pure Python. With it all kernels
are compiled for a baseline processor, and the wheel gets a tag for this platform and
this version of Python. The code is used where Python, numba, llvmlite, NumPy's minor
version and the sources are those it was built with, and the processor has what the
baseline asks for; elsewhere kernels are compiled at their first use, as without it.
"""

import os
import platform
import subprocess
import sys
import sysconfig
import tempfile
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class Prebuild(BuildHookInterface):
    """Puts machine code into the wheel."""

    def is_wanted(self) -> bool:
        """Tell whether this is a wheel that shall hold machine code."""
        asked = os.environ.get("NAMLCP_PREBUILD", "0") not in ("", "0")
        return asked and self.target_name == "wheel"

    def dependencies(self) -> list[str]:
        """Return what the build needs: all that the package needs to run."""
        return self.metadata.core.dependencies if self.is_wanted() else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile, and add the files and the tag to the wheel."""
        if not self.is_wanted() or version == "editable":
            return
        self.folder = tempfile.TemporaryDirectory()
        start = (
            "import sys; sys.path.insert(0, sys.argv[1]); "
            "from namlcp.compiled.prebuilt import fill; fill(sys.argv[2])"
        )
        source = os.path.join(self.root, "src")
        command = [sys.executable, "-c", start, source, self.folder.name]
        subprocess.run(command, check=True)
        build_data["force_include"][self.folder.name] = "namlcp/prebuilt"
        build_data["pure_python"] = False
        build_data["tag"] = tag()

    def finalize(self, version: str, build_data: dict[str, Any], path: str) -> None:
        """Remove the files, which the wheel holds now."""
        if hasattr(self, "folder"):
            self.folder.cleanup()


def tag() -> str:
    """Return the wheel's tag: this Python on this platform.

    The machine code calls nothing by name but what numba and SciPy give it, so that on
    Linux the version of the C library does not matter.
    """
    name = sysconfig.get_platform().replace("-", "_").replace(".", "_")
    if name.startswith("linux_"):
        kind = (
            "manylinux_2_28" if platform.libc_ver()[0] == "glibc" else "musllinux_1_2"
        )
        name = name.replace("linux", kind, 1)
    python = f"cp{sys.version_info.major}{sys.version_info.minor}"
    return f"{python}-{python}-{name}"
