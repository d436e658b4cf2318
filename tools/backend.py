"""The build backend: meson-python, with a C compiler from PyPI where there is none."""

import os
import shutil
import sys

import mesonpy
from mesonpy import *  # noqa: F403


def has_compiler():
    """Tell whether Meson will find a C compiler."""
    return "CC" in os.environ or any(map(shutil.which, ("cc", "gcc", "clang", "cl")))


def get_requires_for_build_wheel(config_settings=None):
    """Return what a wheel needs to be built."""
    wanted = mesonpy.get_requires_for_build_wheel(config_settings)
    return [*wanted, *([] if has_compiler() else ["ziglang>=0.15"])]


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Build a wheel, by Zig where there is no other compiler."""
    if not has_compiler():
        os.environ["CC"] = f'"{sys.executable}" -m ziglang cc'
        os.environ["AR"] = f'"{sys.executable}" -m ziglang ar'
        os.environ["LDFLAGS"] = "-s"  # else with its debug sections
    return mesonpy.build_wheel(wheel_directory, config_settings, metadata_directory)
