"""The figures of what repeats the paper: tables, parameters, convergence theory."""

from validation.claims.ratios import Figures, least, most, numbers
from validation.harness import Row, csv_files, tables


def of_tables(rows: list[Row]) -> Figures:
    """Return how many of the printed counts and residuals come out."""
    return {
        "printed runs": len(rows),
        "printed runs, counts": len(tables.chosen(rows, count_agrees="True")),
        "printed runs, residuals": len(tables.chosen(rows, residual_agrees="True")),
    }


def of_transcription(rows: list[Row]) -> Figures:
    """Return how many counts of large runs are those of the plain transcription."""
    equal = [row for row in rows if row["iterations"] == row["transcription"]]
    return {"large runs": len(rows), "large runs, counts": len(equal)}


def of_choices(rows: list[Row], name: str) -> Figures:
    """Return how many pairs of method and scene are within 1.3 of the best point.

    Pairs of which no point of the grid converges do not count.
    """
    rows = [row for row in rows if row["grid_sweeps"] != "none"]
    beyond = tables.chosen(rows, within="False")
    return {
        f"{name} pairs": len(rows),
        f"{name} pairs within": len(rows) - len(beyond),
        f"{name} pairs beyond": len(beyond),
        f"{name} pairs not solved": len(tables.chosen(rows, auto_sweeps="none")),
    }


def of_parameters(rows: list[Row]) -> Figures:
    """Return the figures of the fixed scenes, and the worst ratio of each."""
    found = of_choices(rows, "auto")
    with_products = numbers(rows, "ratio_with_products")
    found["auto, worst with products"] = most(with_products)
    for scene in tables.distinct(rows, "scene"):
        ratios = numbers(tables.chosen(rows, scene=scene), "ratio")
        found[f"auto, worst on {scene}"] = most(ratios)
    return found


def of_definition(rows: list[Row]) -> Figures:
    """Return how many matrices are proven, and how near rho(J) is to 1."""
    distances = [float(row["case"].split()[-1]) for row in rows]
    return {
        "h_plus matrices": sum(numbers(rows, "matrices")),
        "h_plus proven": sum(numbers(rows, "proven")),
        "h_plus undecided": sum(numbers(rows, "undecided")),
        "h_plus, nearest": least(distances),
    }


def of_h_plus(rows: list[Row]) -> Figures:
    """Return the times of is_h_plus, and those of a linear solve [s]."""
    found: Figures = {}
    for row in rows:
        seconds = csv_files.number(row["is_h_plus"])
        found[f"h_plus, {row['case']}"] = seconds
        sweep = csv_files.number(row["sweep"])
        found[f"h_plus, {row['case']}, sweeps"] = seconds / sweep
        solve = csv_files.number(row["linear_solve"])
        found[f"h_plus, {row['case']}, linear solve"] = solve
    return found


def of_proofs(rows: list[Row]) -> Figures:
    """Return how many proven runs converge, and how many refuted ones do not."""
    columns = {
        "proven": "runs proven",
        "converged": "runs proven that converge",
        "refuted": "runs refuted",
        "did_not": "runs refuted that do not converge",
    }
    return {name: sum(numbers(rows, column)) for column, name in columns.items()}


FILES = {
    "paper-tables": of_tables,
    "paper-large": of_transcription,
    "parameters": of_parameters,
    "h_plus-definition": of_definition,
    "h_plus": of_h_plus,
    "convergence-proofs": of_proofs,
}
