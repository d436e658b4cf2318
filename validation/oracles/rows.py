"""Rows of the agreement table: a quantity of a scene by a solver, and its reference."""

from validation.harness import Row


def row_of(
    scene: str,
    n: int,
    solver: str,
    quantity: str,
    value: float | None = None,
    reference: tuple[float, float, str] | None = None,
    why: str = "",
) -> Row:
    """Return a row; it agrees if |value - reference| is within the tolerance.

    `reference` is the value, the absolute tolerance and whose it is.
    """
    row: Row = {"scene": scene, "n": n, "solver": solver, "quantity": quantity}
    row |= {"value": value, "reference": None, "source": "", "error": None}
    row |= {"tolerance": None, "agrees": False, "residual": None, "why": why}
    if reference is not None and value is not None:
        row["reference"], row["tolerance"], row["source"] = reference
        row["error"] = abs(value - reference[0])
        row["agrees"] = bool(row["error"] <= reference[1])
    return row


def compared(
    scene: str,
    n: int,
    quantity: str,
    values: dict[str, float],
    reference: tuple[float, float, str],
) -> list[Row]:
    """Return the rows of all solvers for one quantity."""
    return [
        row_of(scene, n, solver, quantity, value, reference)
        for solver, value in values.items()
    ]
