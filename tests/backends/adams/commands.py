"""A reader of View's command files (.cmd), from its documented commands; an ampersand continues a line."""

from __future__ import annotations

import math
import re
import sys

model = sys.modules["adams_readers.model"]
multibody = sys.modules["adams_readers.multibody"]

ANGLES = {"radians": 1.0, "rad": 1.0, "deg": math.pi / 180.0, "degrees": math.pi / 180.0}
LENGTHS = {"meter": 1.0, "m": 1.0, "mm": 1.0e-3}


def commands(text):
    """(words of the command, parameters: name to list of texts), in order."""
    joined, whole = "", []
    for line in map(str.rstrip, text.splitlines()):
        if line.lstrip().startswith("!"):
            assert not joined, "a comment inside a command"
            continue
        if line.endswith("&"):
            joined += line[:-1] + " "
        else:
            joined += line
            if joined.strip():
                whole.append(joined.strip())
            joined = ""
    assert not joined, "the last line continues"
    return [_split(command) for command in whole]


def _split(command):
    # words before the first parameter are the command itself
    pieces = re.findall(r'"[^"]*"|[^\s=,]+|=|,', command)
    words, parameters, key = [], {}, None
    for place, piece in enumerate(pieces):
        following = pieces[place + 1] if place + 1 < len(pieces) else ""
        if piece in ("=", ","):
            continue
        if following == "=":
            key = piece
            assert key not in parameters, f"{key} twice in {command[:60]!r}"
            parameters[key] = []
        elif key is None:
            words.append(piece)
        else:
            parameters[key].append(piece)
    return " ".join(words), parameters


class Reader:
    """Follows the commands one by one."""

    def __init__(self):
        self.found = model.Found()
        self.angle = self.length = None
        self.model = self.here = ""

    def read(self, text):
        for words, parameters in commands(text):
            handler = getattr(self, "do_" + words.replace(" ", "_"), None)
            assert handler, f"unknown command {words!r}"
            handler(parameters)
        return self.found

    def _numbers(self, values):
        return [math.radians(float(v[:-1])) if v[-1] in "dD" else float(v) for v in values]

    def _pose(self, p):
        angles = [
            math.radians(float(v[:-1])) if v[-1] in "dD" else float(v) * self.angle for v in p.get("orientation", "000")
        ]
        return multibody.frame(model.body313(angles), [float(v) * self.length for v in p["location"]])

    @staticmethod
    def _text(values):
        assert all(value.startswith('"') for value in values)
        return "".join(value[1:-1] for value in values)

    def do_defaults_units(self, p):
        if "angle" in p:
            self.angle, self.length = ANGLES[p["angle"][0]], LENGTHS[p["length"][0]]
            assert (p["force"], p["mass"], p["time"]) == (["newton"], ["kg"], ["second"])
        else:
            assert (p["coordinate_system_type"], p["orientation_type"]) == (["cartesian"], ["body313"])

    def do_model_create(self, p):
        self.model = "." + p["model_name"][0]
        self.found.ground = self.model + ".ground"
        self.found.parts[self.found.ground] = model.Part(multibody.frame())

    def do_defaults_model(self, p):
        assert p["part_name"] == ["ground"]

    def do_defaults_coordinate_system(self, p):
        self.here = p["default_coordinate_system"][0]
        assert self.here in self.found.parts

    def do_force_create_body_gravitational(self, p):
        self.found.gravity = tuple(float(p[f"{axis}_component_gravity"][0]) for axis in "xyz")

    def do_part_create_rigid_body_name_and_position(self, p):
        assert self.here == self.found.ground, "placed in another part"
        self.found.parts[p["part_name"][0]] = model.Part(self._pose(p))

    def do_marker_create(self, p):
        name = p["marker_name"][0]
        assert name.rpartition(".")[0] == self.here, "a marker on another part than the coordinates are given in"
        assert name not in self.found.markers
        self.found.markers[name] = model.Marker(self.here, self._pose(p))

    def do_floating_marker_create(self, p):
        name = p["floating_marker_name"][0]
        self.found.markers[name] = model.Marker(name.rpartition(".")[0], None)

    def do_part_create_rigid_body_mass_properties(self, p):
        part = self.found.parts[p["part_name"][0]]
        part.mass, part.center = float(p["mass"][0]), p["center_of_mass_marker"][0]
        assert part.center in self.found.markers, "the center's marker comes later"
        part.moments = tuple(float(p[key][0]) for key in ("ixx", "iyy", "izz"))
        part.integrals = tuple(float(p[key][0]) for key in ("ixy", "izx", "iyz"))

    def do_data_element_create_spline(self, p):
        self.found.splines[p["spline_name"][0]] = tuple(tuple(map(float, p[key])) for key in "xy")

    def _joint(self, kind, p):
        name = p["joint_name"][0].rpartition(".")[2]
        self.found.joints[name] = (kind, p["i_marker_name"][0], p["j_marker_name"][0])
        keys = ("rotational_ic", "angular_velocity_ic")
        if keys[0] in p:
            self.found.initial[name] = tuple(float(p[key][0]) for key in keys)

    def do_constraint_create_joint_revolute(self, p):
        self._joint("revolute", p)

    def do_constraint_create_joint_translational(self, p):
        self._joint("prismatic", p)

    def do_data_element_create_variable(self, p):
        self.found.variables[p["variable_name"][0]] = self._text(p["function"])

    def do_constraint_create_motion_generator(self, p):
        assert p["time_derivative"] == ["displacement"]
        kind = {"rotational": "revolute", "translational": "prismatic"}[p["type_of_freedom"][0]]
        joint = p["joint_name"][0].rpartition(".")[2]
        name = p["motion_name"][0].rpartition(".")[2]
        self.found.motions[name] = (joint, kind, self._text(p["function"]))

    def do_force_create_element_like_rotational_spring_damper(self, p):
        # stiffness is per model angle unit
        k, b = float(p["stiffness"][0]) / self.angle, float(p["damping"][0]) / self.angle
        rest = float(p["displacement_at_preload"][0]) * self.angle
        i, j = p["i_marker_name"][0], p["j_marker_name"][0]
        function = f"{float(p['preload'][0])!r} - {k!r}*(AZ({i},{j}) - ({rest!r})) - {b!r}*WZ({i},{j},{j})"
        self.found.forces[p["spring_damper_name"][0].rpartition(".")[2]] = ("revolute", i, j, function)

    def do_force_create_direct_single_component_force(self, p):
        assert (p["type_of_freedom"], p["action_only"]) == (["rotational"], ["off"])
        name = p["single_component_force_name"][0].rpartition(".")[2]
        self.found.forces[name] = (
            "revolute", p["i_marker_name"][0], p["j_marker_name"][0], self._text(p["function"])
        )  # fmt: skip

    def do_force_create_direct_force_vector(self, p):
        assert self.found.markers[p["j_floating_marker_name"][0]].frame is None
        assert self._text(p["x_force_function"]) == self._text(p["y_force_function"]) == "0.0"
        reference = p["ref_marker_name"][0]
        assert self.found.markers[reference].part == self.found.markers[p["j_floating_marker_name"][0]].part
        name = p["force_vector_name"][0].rpartition(".")[2]
        self.found.forces[name] = ("prismatic", p["i_marker_name"][0], reference, self._text(p["z_force_function"]))

    def do_output_control_create_request(self, p):
        names = [value.strip('"') for value in p["component_names"]]
        self.found.requests[p["request_name"][0].rpartition(".")[2]] = {
            names[k - 1]: self._text(p[f"f{k}"]) for k in range(1, 9) if f"f{k}" in p
        }

    def _nothing(self, p):
        """Of graphics and settings of the run no mechanics depends."""

    do_geometry_create_shape_cylinder = do_geometry_create_shape_block = do_geometry_create_shape_ellipsoid = _nothing
    do_executive_control_set_numerical_integration_parameters = do_simulation_script_create = _nothing


def read(text):
    """What a command file says."""
    return Reader().read(text)
