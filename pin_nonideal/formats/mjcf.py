"""MJCF files (MuJoCo's XML), read with care.

Pinocchio's reader drops, without a word, every root body but the first, bodies and joints without a name,
included files, the option gravity, joint springs, and most of `<equality>`.  Here the file is put into a form
it reads in full, and equalities become constraints; what cannot be honored is an error or a note.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from pin_nonideal.errors import LoadingError
from pin_nonideal.forces import JointSpring
from pin_nonideal.types import GeometryModel, Model

from .mjcf_equality import equality_constraints
from .mjcf_text import Defaults, degrees_to_radians
from .urdf import RobotFile
from .xml import numbers, parse_xml, read_text

READ = (
    "compiler",
    "option",
    "asset",
    "worldbody",
    "keyframe",
    "size",
    "visual",
    "statistic",
    "custom",
)
IN_BODY = ("body", "joint", "freejoint", "geom", "site", "inertial", "camera", "light")
POSE = ("pos", "quat", "axisangle", "xyaxes", "zaxis", "euler")
WORLD = "worldbody"


def read_mjcf(path: Path) -> RobotFile:
    """Reads an MJCF file.

    Args:
        path: the file.

    Raises:
        LoadingError: the file is malformed, or states something that cannot be honored.
    """
    root = parse_xml(read_text(path), path, "mujoco")
    where = f'"{path}"'
    for element in root.iter():
        if element.tag in ("include", "frame", "replicate", "attach", "composite", "flexcomp", "plugin"):
            raise LoadingError(f"{where}: <{element.tag}> is not read; write its content out in this file")
    world = root.find(WORLD)
    if world is None or world.find("body") is None:
        raise LoadingError(f"{where} must have a <worldbody> with at least one <body>")
    defaults = Defaults(root)
    defaults.write_out(root)
    notes = [f"<{e.tag}> of the MJCF file is not read" for e in root if e.tag not in (*READ, "equality")]
    joints = _prepare_bodies(world, where)
    notes += _absolute_meshes(root, path, where)
    equality = root.find("equality")
    for element in [e for e in root if e.tag not in READ]:
        root.remove(element)
    model, visual, collision = _build(root, where)
    missing = [n for n in joints if not model.existJointName(n)]
    if missing:
        raise LoadingError(
            f'{where}: joint "{missing[0]}" is dropped by Pinocchio\'s MJCF reader; give its body a mass'
        )
    gravity = numbers(root.find("option"), "gravity", 3, (0.0, 0.0, -9.81), f"{where}: option")
    model.gravity = pin.Motion(gravity, np.zeros(3))
    q0 = next(
        (np.array(e.data()) for e in model.referenceConfigurations if e.key() == "qpos0"), pin.neutral(model)
    )
    robot = RobotFile(model, visual, collision, notes=notes, q0=q0)
    robot.forces = _springs(root, joints, defaults, where, notes)
    if equality is not None:
        robot.constraints = equality_constraints(equality, root, defaults, model, q0, where, notes)
    return robot


def _prepare_bodies(world: ElementTree.Element, where: str) -> dict[str, ElementTree.Element]:
    """Names every body and joint, gives each joint a body of its own, and hangs all on one static body.

    Returns:
        The joints' elements by name.
    """
    joints: dict[str, ElementTree.Element] = {}
    taken = {e.get("name") for e in world.iter("body")}
    for i, body in enumerate(world.iter("body")):
        for child in body:
            if child.tag not in IN_BODY:
                raise LoadingError(f'{where}: <{child.tag}> in body "{body.get("name")}" is not read')
        if not body.get("name"):
            body.set("name", _free_name(f"body_{i}", taken))
    for body in list(world.iter("body")):
        own = [c for c in body if c.tag in ("joint", "freejoint")]
        for joint in own:
            name = joint.get("name") or _free_name(f"{body.get('name')}_{joint.tag}", joints)
            if name in joints:
                raise LoadingError(f'{where}: joint names must be unique; "{name}" appears twice')
            joint.set("name", name)
            joints[name] = joint
        if len(own) > 1:
            _split(body, own)
    carrier = ElementTree.Element("body", {"name": _free_name("world_", taken)})
    carrier.extend(list(world))
    for element in list(world):
        world.remove(element)
    world.append(carrier)
    return joints


def _free_name(wanted: str, taken: Collection[str | None]) -> str:
    name, i = wanted, 1
    while name in taken:
        i += 1
        name = f"{wanted}_{i}"
    return name


def _split(body: ElementTree.Element, own: list[ElementTree.Element]) -> None:
    """Moves all but the last joint of a body to massless bodies around it, in the same order."""
    content = [c for c in body if c not in own[:-1]]
    attributes = dict(body.attrib)
    name = attributes["name"]
    body.clear()
    body.attrib.update({k: v for k, v in attributes.items() if k in POSE})
    shell = body
    for i, joint in enumerate(own[:-1]):
        shell.set("name", f"{name}_{joint.get('name')}")
        shell.append(joint)
        inner = ElementTree.SubElement(shell, "body", {"name": name})
        if i == len(own) - 2:
            inner.attrib.update({k: v for k, v in attributes.items() if k not in POSE})
            inner.extend(content)
        shell = inner


def _absolute_meshes(root: ElementTree.Element, path: Path, where: str) -> list[str]:
    """Makes mesh paths absolute; geoms whose mesh is nowhere are left out with a note."""
    compiler = root.find("compiler")
    if compiler is None:
        compiler = ElementTree.SubElement(root, "compiler")
        root.remove(compiler)
        root.insert(0, compiler)
    folder = path.resolve().parent
    base = folder / (compiler.get("meshdir") or compiler.get("assetdir") or ".")
    compiler.set("meshdir", str(base))
    notes = []
    for mesh in list(root.iterfind("asset/mesh")):
        filename = mesh.get("file")
        if filename is None:
            continue
        name = mesh.get("name") or Path(filename).stem
        mesh.set("name", name)
        target = base / (Path(filename).name if compiler.get("strippath") == "true" else filename)
        if target.is_file():
            mesh.set("file", str(target.resolve()))
            continue
        notes.append(f'mesh "{filename}" was not found; its shape is left out')
        for assets in root.findall("asset"):
            if mesh in list(assets):
                assets.remove(mesh)
        for body in root.iter("body"):
            for geom in [g for g in body.findall("geom") if g.get("mesh") == name]:
                if (
                    body.find("inertial") is None
                    and len(body.findall("geom")) == 1
                    and body.find("joint") is not None
                ):
                    raise LoadingError(
                        f'{where}: body "{body.get("name")}" has its mass from mesh "{filename}", which was '
                        "not found; put the mesh there or give the body an <inertial>"
                    )
                body.remove(geom)
    return notes


def _build(root: ElementTree.Element, where: str) -> tuple[Model, GeometryModel, GeometryModel]:
    """Pinocchio's reader on the prepared file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.xml"
        file.write_text(ElementTree.tostring(root, encoding="unicode"), encoding="utf-8")
        try:
            model = pin.buildModelFromMJCF(str(file))
            visual, collision = (
                pin.buildGeomFromMJCF(model, str(file), kind)
                for kind in (pin.GeometryType.VISUAL, pin.GeometryType.COLLISION)
            )
        except (ValueError, RuntimeError, IndexError) as error:
            raise LoadingError(
                f"{where} cannot be read by Pinocchio: {' '.join(str(error).split())}"
            ) from None
    model.name = root.get("model") or model.name
    return model, visual, collision


def _springs(
    root: ElementTree.Element,
    joints: dict[str, ElementTree.Element],
    defaults: Defaults,
    where: str,
    notes: list[str],
) -> list[JointSpring]:
    """Joint springs, from `stiffness` and `springref`."""
    result = []
    for name, joint in joints.items():
        if joint.tag == "freejoint":
            continue
        place = f'{where}: joint "{name}"'
        filled = defaults.filled(joint)
        stiffness = float(numbers(filled, "stiffness", 1, (0,), place)[0])
        if stiffness == 0.0:
            continue
        kind = filled.get("type", "hinge")
        if kind not in ("hinge", "slide"):
            notes.append(f'joint "{name}": the spring of a {kind} joint is left out')
            continue
        unit = degrees_to_radians(root) if kind == "hinge" else 1.0
        rest = unit * float(numbers(filled, "springref", 1, (0,), place)[0])
        result.append(JointSpring(name, stiffness, rest, name=f"{name} spring"))
    return result
