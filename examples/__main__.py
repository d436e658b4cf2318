"""Run an example: python -m examples NAME [--picture FILE]."""

import argparse
import sys

from examples import EXAMPLES, show_example

parser = argparse.ArgumentParser(prog="python -m examples")
parser.add_argument("name", choices=EXAMPLES, metavar="NAME", help=", ".join(EXAMPLES))
parser.add_argument("--picture", metavar="FILE", help="draw it into this file")
args = parser.parse_args()
sys.exit(show_example(args.name, args.picture))
