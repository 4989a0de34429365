"""Small HTML tables that notebooks show for scenes, runs, solutions, sweeps and states of rest."""

from __future__ import annotations

import html
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

NAMES_MAX = 8  # names in a cell
CELL_MAX = 400  # characters of a cell


def table(title: str, rows: Sequence[Sequence[object]], header: Sequence[str] = ()) -> str:
    """Return a table as HTML that needs no style sheet, script or network.

    Args:
        title: caption.
        rows: cells of each row; the first cell is its heading.
        header: headings of the columns, or none.

    Returns:
        The table, with all text escaped.
    """
    top = f"<tr>{''.join(_cell('th', x) for x in header)}</tr>" if header else ""
    lines = [_cell("th", row[0]) + "".join(_cell("td", x) for x in row[1:]) for row in rows]
    body = "".join(f"<tr>{line}</tr>" for line in lines)
    return f"<table><caption>{_escape(title)}</caption>{top}{body}</table>"


def names(listed: Sequence[str]) -> str:
    """Return the number of names and the first names, for a cell.

    Args:
        listed: the names.
    """
    if not listed:
        return "none"
    more = ", ..." if len(listed) > NAMES_MAX else ""
    return f"{len(listed)}: {', '.join(listed[:NAMES_MAX])}{more}"


def numbers(values: NDArray[np.generic]) -> str:
    """Return an array with six digits for a cell, shortened beyond 20 numbers.

    Args:
        values: the numbers.
    """
    return np.array2string(values, precision=6, threshold=20)


def _cell(tag: str, value: object) -> str:
    return f'<{tag} style="text-align: left">{_escape(str(value))}</{tag}>'


def _escape(text: str) -> str:
    cut = text if len(text) <= CELL_MAX else f"{text[:CELL_MAX]} ..."
    return html.escape(cut).replace("\n", "<br>")
