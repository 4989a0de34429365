"""Ctrl-C as in a terminal: a shell in whose background the tests run lets them and their children ignore it."""

from __future__ import annotations

import signal

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
