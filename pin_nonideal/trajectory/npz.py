"""NumPy archives built in one pass, faster than np.savez for a large number of small files."""

from __future__ import annotations

import io
import struct
from collections.abc import Mapping
from functools import lru_cache
from zlib import crc32

import numpy as np

from pin_nonideal.types import Array

# Records of a zip archive with uncompressed members: signatures and the fields that follow them.
LOCAL = struct.Struct("<4s5H3I2H")
CENTRAL = struct.Struct("<4s6H3I5H2I")
END = struct.Struct("<4s4H2IH")
VERSION, STORED, UTF8 = 20, 0, 0x800
TIME, DATE = 0, (1 << 5) | 1  # 1980-01-01, so that archives of equal arrays are equal
MAX_BYTES = 1_000_000_000  # larger archives need 64-bit fields, which np.savez writes


def npz_bytes(arrays: Mapping[str, Array]) -> bytes:
    """Return an uncompressed .npz archive, five times as fast as np.savez for small arrays.

    Args:
        arrays: arrays of numbers or text, by name.
    """
    if sum(x.nbytes for x in arrays.values()) > MAX_BYTES:
        stream = io.BytesIO()
        np.savez(stream, **dict(arrays))  # type: ignore[arg-type]
        return stream.getvalue()
    members: list[bytes] = []
    directory: list[bytes] = []
    at = 0
    for key, x in arrays.items():
        name = f"{key}.npy".encode()
        content = _header(x.dtype.str, x.shape) + x.tobytes()
        size = len(content)
        common = (VERSION, UTF8, STORED, TIME, DATE, crc32(content), size, size, len(name), 0)
        members += (LOCAL.pack(b"PK\3\4", *common), name, content)
        directory += (CENTRAL.pack(b"PK\1\2", VERSION, *common, 0, 0, 0, 0, at), name)
        at += LOCAL.size + len(name) + size
    listed = b"".join(directory)
    end = END.pack(b"PK\5\6", 0, 0, len(arrays), len(arrays), len(listed), at, 0)
    return b"".join((*members, listed, end))


@lru_cache(maxsize=1000)
def _header(dtype: str, shape: tuple[int, ...]) -> bytes:
    """Return the header of an array in row-major order."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": shape})
    return stream.getvalue()
