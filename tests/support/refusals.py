"""Comparison of errors with their full messages."""

from __future__ import annotations

import re

import pytest

from pin_nonideal.errors import LoadingError


def refuses(message, error=LoadingError):
    """Assert that the block raises the error with the exact message in it."""
    return pytest.raises(error, match=re.escape(message))
