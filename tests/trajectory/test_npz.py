"""Archives that are written in one pass equal NumPy's archives."""

from __future__ import annotations

import io
import zipfile

import numpy as np
import pytest

from pin_nonideal.trajectory import npz

ARRAYS = {
    "t": np.linspace(0.0, 1.0, 7),
    "q/0": np.arange(12.0).reshape(3, 4),
    "columns": np.asfortranarray(np.arange(12.0).reshape(3, 4)),
    "every second": np.arange(12.0)[::2],
    "none": np.zeros((0, 3)),
    "modes": np.array([[1, -1]], dtype=np.int8),
    "long": np.array([2**40]),
    "header": np.array('{"name": "\u00e4"}'),
    "bytes": np.array(b"{}"),
}


@pytest.mark.parametrize("most", [npz.MAX_BYTES, 0])
def test_numpy_and_zip_read_what_is_made(monkeypatch, most):
    """Whether it is put together here, or by NumPy as archives of gigabytes are."""
    monkeypatch.setattr(npz, "MAX_BYTES", most)
    content = npz.npz_bytes(ARRAYS)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        assert archive.testzip() is None
        assert archive.namelist() == [f"{name}.npy" for name in ARRAYS]
    read = np.load(io.BytesIO(content), allow_pickle=False)
    assert list(read) == list(ARRAYS)
    for name, x in ARRAYS.items():
        assert read[name].dtype == x.dtype
        np.testing.assert_array_equal(read[name], x)


def test_equal_arrays_make_equal_archives():
    assert npz.npz_bytes(ARRAYS) == npz.npz_bytes(dict(ARRAYS))


def test_a_spoiled_member_is_noticed():
    content = bytearray(npz.npz_bytes({"t": np.arange(5.0)}))
    content[content.index(np.arange(5.0).tobytes())] ^= 1
    with pytest.raises(zipfile.BadZipFile):
        np.load(io.BytesIO(bytes(content)))["t"]
