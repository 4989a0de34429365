"""A matplotlib figure that a notebook shows without pyplot or an inline backend."""

from __future__ import annotations

import io

from matplotlib.figure import Figure

RESOLUTION = 110  # resolution of pictures in a notebook [dots per inch]


class NotebookFigure(Figure):
    """Figure that a notebook shows as the result of a cell."""

    def _repr_png_(self) -> bytes:
        picture = io.BytesIO()
        self.savefig(picture, format="png", dpi=RESOLUTION)
        return picture.getvalue()
