"""Random MJCF files: trees with all joints, springs, tendons, actuators, equalities and fluid."""

from __future__ import annotations

import random

from hypothesis import strategies as st


class Writer:
    """Writer of one random file."""

    def __init__(self, rnd):
        self.rnd = rnd
        self.hinges, self.balls, self.frees, self.bodies, self.sites = [], [], [], [], []
        self.count = 0

    def chance(self, part):
        return self.rnd.random() < part

    def number(self, low, high):
        return round(self.rnd.uniform(low, high), 4)

    def vector(self, low=-1.0, high=1.0, n=3):
        return " ".join(str(self.number(low, high)) for _ in range(n))

    def new(self, kind):
        self.count += 1
        return f"{kind}{self.count}"

    def maybe(self, part, key, value):
        return f' {key}="{value}"' if self.chance(part) else ""

    def coefficients(self, part, key, high):
        if not self.chance(part):
            return ""
        higher = f" {self.number(0, high)} {self.number(0, high)}" if self.chance(0.3) else ""
        return f' {key}="{self.number(0, high)}{higher}"'

    def pose(self):
        kind = self.rnd.choice(["quat", "euler", "axisangle", "zaxis", "xyaxes", ""])
        turn = {
            "quat": f' quat="{self.vector(0.1, 1.0, 4)}"',
            "euler": f' euler="{self.vector()}"',
            "axisangle": f' axisangle="{self.vector(0.1, 2.0, 4)}"',
            "zaxis": f' zaxis="{self.vector(0.1, 1.0)}"',
            "xyaxes": ' xyaxes="1 0.2 0 -0.1 1 0.3"',
            "": "",
        }[kind]
        return f' pos="{self.vector()}"{turn}'

    def joint(self, kind):
        name = self.new("j")
        text = f'<joint name="{name}" type="{kind}" pos="{self.vector(-0.2, 0.2)}"'
        text += self.coefficients(0.4, "stiffness", 5.0) + self.coefficients(0.5, "damping", 2.0)
        text += self.maybe(0.4, "armature", self.number(0.01, 0.5))
        text += self.maybe(0.3, "frictionloss", self.number(0.01, 1.0))
        if kind == "ball":
            self.balls.append(name)
            return text + "/>"
        self.hinges.append(name)
        axis = self.rnd.choice(["1 0 0", "0 1 0", "0 0 1", self.vector(0.1, 1.0)])
        text += f' axis="{axis}"' + self.maybe(0.3, "ref", self.number(-0.5, 0.5))
        text += self.maybe(0.3, "springref", self.number(-0.5, 0.5))
        text += self.maybe(0.2, "range", "-0.5 0.7") + self.maybe(0.2, "actuatorfrcrange", "-0.4 0.5")
        return text + self.maybe(0.15, "actuatorgravcomp", "true") + "/>"

    def free(self):
        name = self.new("free")
        self.frees.append(name)
        if self.chance(0.5):
            return f'<freejoint name="{name}"/>'
        text = f'<joint name="{name}" type="free"' + self.coefficients(0.5, "damping", 1.0)
        text += self.coefficients(0.3, "stiffness", 2.0) + self.maybe(0.4, "armature", self.number(0.1, 0.5))
        return text + self.maybe(0.3, "frictionloss", self.number(0.1, 0.5)) + "/>"

    def geom(self):
        kind, size = self.rnd.choice(
            [("sphere", 1), ("capsule", 2), ("box", 3), ("ellipsoid", 3), ("cylinder", 2)]
        )
        text = f'<geom type="{kind}" size="{self.vector(0.05, 0.3, size)}"{self.pose()}'
        text += self.maybe(0.3, "density", self.number(300, 2000)) + self.maybe(0.2, "contype", "0")
        return text + self.maybe(0.1, "group", "4") + "/>"

    def body(self, depth, root=False):
        name = self.new("body")
        text = f'<body name="{name}"{self.pose()}' + self.maybe(0.3, "gravcomp", self.number(0, 1.2)) + ">"
        self.bodies.append(name)
        if root and self.chance(0.3):
            text += self.free()
        elif not (depth > 1 and self.chance(0.15)):  # without a joint: fixed to its parent
            kinds = self.rnd.choice(
                [["ball"], ["hinge"], ["hinge", "slide"], ["slide", "hinge", "hinge"], ["slide", "ball"]]
            )
            text += "".join(self.joint(kind) for kind in kinds)
        if self.chance(0.4):
            text += f'<inertial pos="{self.vector(-0.2, 0.2)}" mass="{self.number(0.5, 3)}" '
            text += f'fullinertia="0.5 0.6 0.7 {self.vector(-0.1, 0.1)}"/>'
        text += "".join(self.geom() for _ in range(self.rnd.choice([1, 1, 2])))
        site = self.new("s")
        self.sites.append((site, name))
        text += f'<site name="{site}"{self.pose()}/>'
        if depth < 4:
            children = self.rnd.choice([0, 1, 1, 2])
            text += "".join(self.body(depth + 1) for _ in range(children))
        return text + "</body>"

    def tendons(self):
        text, names = "", []
        for _ in range(self.rnd.choice([0, 0, 1, 2])):
            name = self.new("t")
            extra = self.coefficients(0.6, "stiffness", 5.0) + self.coefficients(0.5, "damping", 1.0)
            extra += self.maybe(0.2, "frictionloss", self.number(0.1, 0.5))
            extra += self.maybe(0.4, "springlength", self.rnd.choice(["0.3", "0.1 0.5", "0"]))
            if self.chance(0.5) and self.hinges:
                joints = self.rnd.sample(self.hinges, min(len(self.hinges), self.rnd.choice([1, 2, 3])))
                inside = "".join(f'<joint joint="{j}" coef="{self.number(-2, 2)}"/>' for j in joints)
                text += f'<fixed name="{name}"{extra}>{inside}</fixed>'
            elif len(self.sites) > 2:
                path = self.rnd.sample([s for s, _ in self.sites], self.rnd.choice([2, 3]))
                inside = "".join(f'<site site="{s}"/>' for s in path)
                if self.chance(0.4):
                    ends = self.rnd.sample([s for s, _ in self.sites], 2)
                    inside += '<pulley divisor="2"/>' + "".join(f'<site site="{s}"/>' for s in ends)
                text += f'<spatial name="{name}"{extra}>{inside}</spatial>'
            else:
                continue
            names.append(name)
        return text, names

    def transmission(self, tendons):
        gear = f' gear="{self.vector(-2, 2, 6)}"'
        sites = [s for s, _ in self.sites]
        options = [f'joint="{j}"{gear}' for j in self.hinges]
        options += [
            f'{key}="{j}"{gear}' for j in self.balls + self.frees for key in ("joint", "jointinparent")
        ]
        options += [f'tendon="{t}"{gear}' for t in tendons]
        options += [f'site="{self.rnd.choice(sites)}"{gear}'] if sites else []
        if len(sites) > 1:
            one, two = self.rnd.sample(sites, 2)
            parts = self.rnd.choice([self.vector(-2, 2) + " 0 0 0", "0 0 0 " + self.vector(-2, 2)])
            options.append(f'site="{one}" refsite="{two}" gear="{parts}"')
            options.append(f'cranksite="{one}" slidersite="{two}" cranklength="0.7"')
        return self.rnd.choice(options)

    def actuators(self, tendons):
        text = ""
        for _ in range(self.rnd.choice([0, 1, 2, 3])):
            limits = self.maybe(0.3, "ctrlrange", "-0.5 0.6") + self.maybe(0.3, "forcerange", "-1 2")
            place = self.transmission(tendons) + limits
            kind = self.rnd.choice(["motor", "position", "velocity", "general", "damper"])
            if kind == "damper":
                place = place.split(" ctrlrange")[0].split(" forcerange")[0] + ' ctrlrange="0 1"'
            text += {
                "motor": f"<motor {place}/>",
                "position": f'<position {place} kp="{self.number(1, 20)}"'
                + self.maybe(0.5, "kv", "0.7")
                + "/>",
                "velocity": f'<velocity {place} kv="{self.number(0.1, 3)}"/>',
                "general": f'<general {place} gaintype="affine" gainprm="{self.vector()}" biastype="affine" '
                f'biasprm="{self.vector()}"/>',
                "damper": f'<damper {place} kv="0.8"/>',
            }[kind]
        return text

    def equalities(self, tendons):
        text = ""
        for _ in range(self.rnd.choice([0, 0, 1, 2])):
            kind = self.rnd.choice(["connect", "weld", "joint", "sites", "tendon"])
            body = self.rnd.choice(self.bodies)
            if kind == "connect":
                text += f'<connect body1="{body}" anchor="{self.vector(-0.3, 0.3)}"/>'
            elif kind == "weld" and self.chance(0.3):
                text += f'<weld body1="{body}"/>'
            elif kind == "joint" and len(self.hinges) > 1:
                one, two = self.rnd.sample(self.hinges, 2)
                powers = self.rnd.choice(["0.1 0.8", "0 -1 0.2 0.1 0.05"])
                text += f'<joint joint1="{one}" joint2="{two}" polycoef="{powers}"/>'
            elif kind == "tendon" and tendons:
                text += f'<tendon tendon1="{tendons[0]}" polycoef="0.02 0 0 0 0"/>'
        return text

    def file(self):
        world = "".join(self.body(1, root=True) for _ in range(self.rnd.choice([1, 1, 2])))
        tendons, names = self.tendons()
        if not self.hinges + self.balls + self.frees:
            world += '<body><joint/><geom size="0.1"/></body>'
        actuators, equalities = self.actuators(names), self.equalities(names)
        compiler = '<compiler angle="radian"' + self.maybe(0.2, "inertiafromgeom", "true")
        compiler += self.maybe(0.2, "settotalmass", "7") + self.maybe(0.2, "balanceinertia", "true")
        compiler += self.maybe(0.3, "eulerseq", self.rnd.choice(["XYZ", "zyx", "xYz"])) + "/>"
        option = "<option" + self.maybe(0.3, "gravity", self.vector(-5, 5))
        if self.chance(0.25):
            option += (
                f' density="{self.number(1, 1000)}" viscosity="{self.number(0, 1)}" wind="{self.vector()}"'
            )
        flag = self.rnd.choice(["gravity", "spring", "damper", "frictionloss", "clampctrl", "equality"])
        option += f'><flag {flag}="disable"/></option>' if self.chance(0.15) else "/>"
        return (
            f'<mujoco>{compiler}{option}<worldbody><site name="ground"/>{world}</worldbody>'
            f"<tendon>{tendons}</tendon><equality>{equalities}</equality><actuator>{actuators}</actuator></mujoco>"
        )


def mjcf_files():
    """Return a strategy for texts of random MJCF files."""
    return st.integers(0, 2**32).map(lambda seed: Writer(random.Random(seed)).file())
