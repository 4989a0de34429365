"""The examples of friction and of contacts print results beside closed forms, and both agree."""

from __future__ import annotations

import base64
import gzip
import importlib.util
import re
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[2] / "examples"
# Runs at rtol 1e-10: events to 1e-9, as tests/friction/test_references_friction.py has them.
PRINTED = 1e-9


def script(name):
    spec = importlib.util.spec_from_file_location(f"examples_{name}", FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


sys.path.insert(0, str(FOLDER))  # as a script has it
FRICTION, CONTACTS = script("friction"), script("contacts")


@pytest.mark.parametrize(
    ("examples", "name"), [(part, name) for part in (FRICTION, CONTACTS) for name in part.EXAMPLES]
)
def test_computed_and_expected_agree(examples, name, capsys):
    examples.main([name])
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
    packed = re.search(r'id="payload">([^<]+)<', page.read_text(encoding="utf-8")).group(1)
    assert b'"slip"' in gzip.decompress(base64.b64decode(packed))


def test_unknown_names_are_told(capsys):
    with pytest.raises(SystemExit):
        FRICTION.main(["nothing"])
    assert "no example nothing; known: loaded_joint" in capsys.readouterr().err
