"""The figures and tables of README.md, docs and validation/README.md.

They are written anew, and claims that do not hold are printed; --check writes nothing
and returns 1 if a document says what the results do not.

A figure that claims something is followed by the name of a claim as a comment,
``0.78<!-- Maros-Meszaros over piqp -->``; it has to be the value, rounded to the digits
that the text gives. A table stands between ``<!-- table: NAME -->`` and ``<!-- end
-->``: the claims of a part ("claims right"), "taken", or one of claims.toml.
"""

import math
import re

from validation.claims import figures
from validation.claims.figures import Figures, Spec, claims
from validation.harness import Row, cli, tables

DOCUMENTS = (
    cli.ROOT / "README.md",
    *sorted((cli.ROOT / "docs").rglob("*.md")),
    cli.ROOT / "validation" / "README.md",
)
MARK = re.compile(r"(\d[\d.]*(?:e-?\d+)?)<!-- ([^:]+?) -->")
BLOCK = re.compile(r"(<!-- table: (.+?) -->\n).*?(?=<!-- end -->)", re.DOTALL)
WIDEST = 200  # characters of a cell


def rounded(value: float, like: str) -> str:
    """Return a value with the digits of a figure, 3e-9 and 3.1e-10 with theirs."""
    mantissa, e, _ = like.partition("e")
    digits = len(mantissa.partition(".")[2])
    if not e:
        return f"{value:.{digits}f}"
    mantissa, _, exponent = f"{value:.{digits}e}".partition("e")
    return f"{mantissa}e{int(exponent)}"


def renewed(text: str, known: Figures) -> str:
    """Return a text with the measured figures; what is not measured stays."""

    def measured(mark: re.Match[str]) -> str:
        said, name = mark.groups()
        value = known.get(name, math.nan)
        return f"{said if math.isnan(value) else rounded(value, said)}<!-- {name} -->"

    return MARK.sub(measured, text)


def of_claims(part: str, known: Figures) -> str:
    lines = (
        (claim.name, claim.limit, f"{claim.value:.4g}", "yes" if claim.holds else "NO")
        for claim in claims(known, part)
    )
    return tables.markdown(("figure", "limit", "measured", "met"), lines)


def taken() -> str:
    files: dict[tuple[str, ...], int] = {}
    headers = map(tables.header, cli.RESULTS.glob("*.csv"))
    for header in filter(None, headers):  # history.csv has none
        said = {name: value for name, _, value in (x.partition(": ") for x in header)}
        key = tuple(said.get(name, "") for name in ("commit", "date", "cpu", "load"))
        files[key] = files.get(key, 0) + 1
    counts = ((*key, count) for key, count in sorted(files.items()))
    return tables.markdown(("commit", "date", "machine", "load", "files"), counts)


def crossed(spec: Spec) -> str:
    """Return a table with a line for each value of `down`, see claims.toml."""
    rows = figures.read(cli.RESULTS / f"{spec['file']}.csv")
    rows = figures.where(rows, spec.get("where", "True"))
    columns = (figures.of(rows, down) for down in spec["down"].values())
    keys = list(zip(*columns, strict=True))
    lines = []
    for key in sorted(set(keys)):
        own = [row for row, found in zip(rows, keys, strict=True) if found == key]
        labels = [x if isinstance(x, str) else f"{x:g}" for x in key]
        lines.append([*labels, *(cell(own, spec, here) for here in spec["columns"])])
    heads = map(spec.get("head", "{}").format, spec["columns"])
    return tables.markdown((*spec["down"], *heads), lines)


def cell(rows: list[Row], spec: Spec, here: str) -> str:
    """Return an entry: its figures but those to `hide`, "-" where there is none."""
    texts = []
    for part in spec["cells"]:
        entries = {key: str(entry).replace("HERE", here) for key, entry in part.items()}
        value = figures.figure(rows, entries)
        if not math.isnan(value) and value != part.get("hide"):
            form = part.get("format")
            texts.append(form.format(value) if form else tables.short(value))
    return ", ".join(texts) or "-"


def table(name: str, known: Figures) -> str:
    if name.startswith("claims "):
        return of_claims(name.removeprefix("claims "), known)
    if name == "taken":
        return taken()
    return crossed(figures.TABLE["tables"][name])


def written(text: str, known: Figures) -> str:
    def block(found: re.Match[str]) -> str:
        begin, name = found.groups()
        return f"{begin}{table(name, known)}\n"

    return BLOCK.sub(block, renewed(text, known))


def faults(text: str, known: Figures) -> list[str]:
    """Return what a document says that the results do not, and cells too wide."""
    found = []
    for said, name in MARK.findall(text):
        value = known.get(name, math.nan)
        if math.isnan(value) or rounded(value, said) != said:
            found.append(f"{name}: {said}, measured {value:g}")
    old, new = (
        [b.group() for b in BLOCK.finditer(t)] for t in (text, written(text, known))
    )
    found += [a.splitlines()[0] for a, b in zip(old, new, strict=True) if a != b]
    cells = (
        c for line in text.splitlines() if line[:1] == "|" for c in line.split("|")
    )
    found += [f"too wide: {wide.strip()[:60]}" for wide in cells if len(wide) > WIDEST]
    return found


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    args = parser.parse_args(arguments)
    known, found = figures.values(), []
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
