"""The table of the world's models is made by one command."""

from __future__ import annotations

from benchmarks import models

from ..support.small_robots import ARM, robot

MJCF = """<mujoco><worldbody><body><joint name="j" damping="0.1"/><geom size="0.1" pos="0.2 0 0"/></body>
    </worldbody>    <actuator><position joint="j" kp="2"/></actuator></mujoco>"""


def test_a_folder_is_a_row(tmp_path, capsys):
    (tmp_path / "arm.urdf").write_text(robot(*ARM))
    (tmp_path / "arm.xml").write_text(MJCF)
    (tmp_path / "part.xml").write_text("<mujoco><worldbody><body><joint/></body></worldbody></mujoco>")
    (tmp_path / "broken.urdf").write_text(robot())
    assert models.main([str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert f"| {tmp_path.name} | 4 | 1 | 2 (67 %) | 0 | 2 | 0 | 1 |" in said
    assert "- 1 refused: must hold at least one <link>; got none" in said
