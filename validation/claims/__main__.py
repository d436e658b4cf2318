"""What the README files say, from the results: write it, or with --check compare.

`python -m validation.claims` writes the figures and tables of README.md and
validation/README.md anew and prints which claims do not hold; --check writes nothing
and returns 1 if a document says what the results do not.
"""

import sys

from validation.claims import DOCUMENTS, claims, faults, values, written
from validation.harness import cli


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    args = parser.parse_args(arguments)
    known, found = values(), []
    for document in DOCUMENTS:
        text = document.read_text()
        name = document.relative_to(cli.ROOT)
        found += [f"{name}: {fault}" for fault in faults(text, known)]
        if not args.check:
            document.write_text(written(text, known))
    for claim in claims(known):
        if not claim.holds:
            print(f"does not hold: {claim.name} {claim.limit}, is {claim.value:.4g}")
    print("\n".join(found))
    return int(args.check and bool(found))


if __name__ == "__main__":
    sys.exit(main())
