"""The friction examples print what they compute beside closed forms; both must agree."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parent.parent / "examples" / "friction.py"
# Runs at rtol 1e-10: events to 1e-9, as tests/test_references_friction.py has them.
PRINTED = 1e-9


def script():
    spec = importlib.util.spec_from_file_location("examples_friction", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


FRICTION = script()


@pytest.mark.parametrize("name", FRICTION.EXAMPLES)
def test_computed_and_expected_agree(name, capsys):
    FRICTION.main([name])
    lines = re.findall(r"^  (.{46}) +(\S+) +(\S+) +(\S+)$", capsys.readouterr().out, re.M)
    assert len(lines) >= 2
    for what, computed, expected, _ in lines:
        assert float(computed) == pytest.approx(float(expected), abs=PRINTED), what
        if what.startswith(("speed", "largest speed")):
            assert float(computed) == 0.0, what


def test_replays_are_written_where_asked(tmp_path, capsys):
    FRICTION.main(["belt_oscillator", "--html", str(tmp_path / "pages")])
    page = tmp_path / "pages" / "belt_oscillator.html"
    assert f"wrote {page}" in capsys.readouterr().out
    assert "slip" in page.read_text(encoding="utf-8")


def test_unknown_names_are_told(capsys):
    with pytest.raises(SystemExit):
        FRICTION.main(["nothing"])
    assert "no example nothing; known: loaded_joint" in capsys.readouterr().err
