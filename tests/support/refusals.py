"""Errors compared with the words that a user reads."""

from __future__ import annotations

import re

import pytest

from pin_nonideal.errors import LoadingError


def refuses(message, error=LoadingError):
    """The block must raise the error, with the message in it letter by letter."""
    return pytest.raises(error, match=re.escape(message))
