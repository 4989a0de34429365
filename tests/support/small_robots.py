"""Small robots for tests of loading."""

from __future__ import annotations

from pathlib import Path

DATA = Path(__file__).parents[1] / "data"
INERTIAL = (
    '<inertial><mass value="{m}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def link(name, mass=1.0, inertia=0.1, inside=""):
    return f'<link name="{name}">{INERTIAL.format(m=mass, i=inertia)}{inside}</link>'


def joint(
    name, parent, child, kind="revolute", axis="0 0 1", xyz="0 0 0", inside="", limits='lower="-3" upper="3"'
):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/><axis xyz="{axis}"/><limit effort="1" velocity="1" {limits}/>'
        f"{inside}</joint>"
    )


ARM = [
    '<link name="base"/>',
    link("upper"),
    joint("shoulder", "base", "upper", axis="0 1 0"),
    link("lower"),
    joint("elbow", "upper", "lower", axis="0 1 0", xyz="1 0 0"),
    '<link name="hand"/>',
    joint("hand_joint", "lower", "hand", kind="fixed", xyz="1 0 0"),
    '<link name="wall"/>',
    joint("wall_joint", "base", "wall", kind="fixed", xyz="1 0 1"),
]


def robot(*parts):
    return f'<robot name="arm">{"".join(parts)}</robot>'


def folder(path, yaml=None, urdf=None):
    """Write a robot folder: robot.urdf (default: the arm), and robot.yaml if given."""
    (path / "robot.urdf").write_text(robot(*ARM) if urdf is None else urdf)
    if yaml is not None:
        (path / "robot.yaml").write_text(yaml)
    return path
