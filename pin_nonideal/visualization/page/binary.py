"""Binary data of a page: typed arrays after a JSON header, and shapes without duplicates."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from pin_nonideal.types import Array, Table

from .visuals import Shape, Visual


class Payload:
    """Run as bytes: a JSON header with references to the typed arrays after it."""

    def __init__(self) -> None:
        self._chunks: list[bytes] = []
        self._length = 0
        self._known: dict[tuple[str, bytes], dict[str, list[Any]]] = {}

    def add(self, values: Any, kind: str = "f4") -> dict[str, list[Any]]:
        """Return a reference to a stored array; equal arrays are stored once.

        Args:
            values: array-like data; stored flat.
            kind: type of the stored numbers, "f4", "f8", "u1", "u2" or "u4".
        """
        chunk = np.ascontiguousarray(values, dtype=f"<{kind}").tobytes()
        if (kind, chunk) not in self._known:
            self._known[kind, chunk] = {"array": [kind, self._length, len(chunk) // int(kind[1])]}
            self._chunks.append(chunk)
            self._length += len(chunk)
        return self._known[kind, chunk]

    def curve(self, values: Array) -> dict[str, list[Any]]:
        """Return a reference to plotted values: 32 bits if they resolve a thousandth of the range, else 64.

        Args:
            values: values of the curve.
        """
        large, range_of = (
            float(np.abs(values).max(initial=0.0)),
            float(np.ptp(values)) if len(values) else 0.0,
        )
        return self.add(values, "f4" if large <= 1e3 * range_of or large == 0.0 else "f8")

    def bytes(self, header: Table) -> bytes:
        """Return the length of the header as four bytes, the header, and the arrays."""
        text = json.dumps(header, allow_nan=False, separators=(",", ":")).encode()
        return b"".join([len(text).to_bytes(4, "little"), text, *self._chunks])


class Shapes:
    """Shapes without duplicates, and the visuals that refer to them by number."""

    def __init__(self, payload: Payload) -> None:
        self.payload = payload
        self.known: dict[bytes, int] = {}
        self.stored: list[Table] = []

    def add(self, visuals: list[Visual]) -> list[Table]:
        """Return visuals in the format of the page."""
        drawn = []
        for visual in visuals:
            key = _fingerprint(visual.shape)
            if key not in self.known:
                self.known[key] = len(self.stored)
                self.stored.append(_stored(self.payload, visual.shape))
            drawn.append(
                {
                    "name": visual.name,
                    "joint": visual.joint,
                    "placement": visual.placement.homogeneous.ravel().tolist(),
                    "shape": self.known[key],
                    "color": list(visual.color),
                }
            )
        return drawn


def _fingerprint(shape: Shape) -> bytes:
    """Return equal bytes for equal shapes."""
    words = repr((shape.kind, shape.size, shape.parts)).encode()
    return b"|".join([words, shape.vertices.tobytes(), shape.triangles.tobytes()])


def _stored(payload: Payload, shape: Shape) -> Table:
    stored: Table = {"kind": shape.kind, "size": list(shape.size)}
    if shape.kind == "mesh":
        stored["vertices"] = payload.add(shape.vertices)
        stored["triangles"] = payload.add(shape.triangles, "u2" if len(shape.vertices) <= 0xFFFF else "u4")
        stored["parts"] = [[count, None if color is None else list(color)] for count, color in shape.parts]
    return stored
