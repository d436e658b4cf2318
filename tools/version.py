#!/usr/bin/env python3
"""Print the version of the package, for meson.build."""

import re
from pathlib import Path

text = Path(__file__).parents[1].joinpath("src/namlcp/__init__.py").read_text()
print(re.search(r'^__version__ = "(.+)"', text, re.M).group(1))
