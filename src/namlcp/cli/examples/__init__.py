"""Examples of sequences of problems, each in a second or two, with a picture.

A module has `run`, which solves, prints what came out and returns a record, and `draw`,
which draws the record into a figure of matplotlib. `catalogue` lists them by name.
"""

from namlcp.cli.examples.catalogue import EXAMPLES, show_example, source
