"""A reader of the Solver's dataset (.adm), from its documented statements: NAME/id, arguments, comma continues."""

from __future__ import annotations

import math
import re
import sys
from itertools import pairwise

model = sys.modules["adams_readers.model"]
multibody = sys.modules["adams_readers.multibody"]

# arguments whose value runs to the next backslash or the end
FUNCTIONS = re.compile(r"(FUNCTION|F[1-8]|F[XYZ])\s*=", re.IGNORECASE)
KEY = re.compile(r"\s*([A-Za-z_]\w*)\s*(=)?\s*")


def read(text):
    """What a dataset says."""
    lines = text.splitlines()
    statements, name = [], ""
    for line in lines[1:]:  # the first line is the title
        comment = re.match(r"!\s*adams_view_name='([^']*)'", line)
        if comment:
            name = comment[1]
        elif line.startswith("!") or not line.strip():
            continue
        elif line.startswith(","):
            assert statements, "a continuation of nothing"
            statements[-1][1].append(line[1:])
        else:
            statements.append((name, [line]))
            name = ""
    assert statements and statements[-1][1] == ["END"], "no END"
    found = model.Found()
    ids = {}
    for name, (first, *rest) in statements[:-1]:
        keyword, _, tail = first.partition("/")
        number, comma, more = tail.partition(",")
        if "=" in number or not number.strip().isdigit():  # no id: arguments begin at once
            number, more, comma = "", tail, ","
        pieces = ([more] if comma else []) + rest
        handler = STATEMENTS.get(keyword.strip().upper())
        assert handler, f"unknown statement {keyword!r}"
        handler(found, number.strip(), _arguments(pieces), name, ids)
    grounds = [part for part, (is_ground) in ids.get("ground", {}).items() if is_ground]
    assert len(grounds) == 1, "GROUND exactly once"
    return found


def _arguments(pieces):
    """Arguments by name; bare words are True; functions keep their text, lists are split at commas."""
    out = {}
    function = None
    for piece in map(str.strip, pieces):
        match = FUNCTIONS.match(piece)
        if match:
            function = match[1].upper()
            out[function] = piece[match.end() :].strip()
        elif function is not None:
            out[function] += " " + piece
        else:
            _plain(piece, out)
        if function is not None and out[function].endswith("\\"):
            out[function] = out[function][:-1].strip()
            function = None
    return out


def _plain(piece, out):
    """Arguments that are no functions: KEY, KEY = value or KEY = value, value ... on one or more lines."""
    for part in map(str.strip, re.findall(r'"[^"]*"|[^,]+', re.sub(r"\s*=\s*", "=", piece))):
        if not part:
            continue
        key, equals, value = part.partition("=")
        if equals:
            out[key.strip().upper()] = [value.strip()]
            out[""] = key.strip().upper()
        elif re.fullmatch(r"[A-Za-z_]\w*", part):
            out[part.upper()] = True
        else:
            out[out[""]].append(part)


def number(text):
    """A number; a D after it means degrees."""
    text = text.strip()
    if text.upper().endswith("D"):
        return math.radians(float(text[:-1]))
    return float(text)


def _pose(arguments, place):
    xyz = [number(value) for value in arguments.get(place, ["0", "0", "0"])]
    angles = [number(value) for value in arguments.get("REULER", ["0", "0", "0"])]
    return multibody.frame(model.body313(angles), xyz)


def _units(found, number_, arguments, name, ids):
    wanted = {"FORCE": "NEWTON", "MASS": "KILOGRAM", "LENGTH": "METER", "TIME": "SECOND"}
    assert {key: value[0].upper() for key, value in arguments.items() if key} == wanted, "not SI"


def _gravity(found, number_, arguments, name, ids):
    found.gravity = tuple(number(arguments[key][0]) for key in ("IGRAV", "JGRAV", "KGRAV"))


def _part(found, number_, arguments, name, ids):
    assert number_ not in found.parts, f"PART/{number_} twice"
    is_ground = "GROUND" in arguments
    ids.setdefault("ground", {})[number_] = is_ground
    if is_ground:
        found.ground = number_
        found.parts[number_] = model.Part(multibody.frame())
        return
    moments = [number(value) for value in arguments["IP"]] + [0.0] * 3
    assert "IM" not in arguments
    found.parts[number_] = model.Part(
        _pose(arguments, "QG"),
        number(arguments["MASS"][0]),
        arguments["CM"][0],
        tuple(moments[:3]),
        tuple(moments[3:6]),
    )


def _marker(found, number_, arguments, name, ids):
    assert number_ not in found.markers, f"MARKER/{number_} twice"
    floats = "FLOATING" in arguments
    found.markers[number_] = model.Marker(arguments["PART"][0], None if floats else _pose(arguments, "QP"))
    ids.setdefault("markers", {})[number_] = name


def _joint(found, number_, arguments, name, ids):
    kind = "revolute" if "REVOLUTE" in arguments else "prismatic"
    assert kind == "revolute" or "TRANSLATIONAL" in arguments
    ids.setdefault("joints", {})[number_] = name or number_
    found.joints[name or number_] = (kind, arguments["I"][0], arguments["J"][0])
    if "IC" in arguments:
        found.initial[name or number_] = tuple(number(value) for value in arguments["IC"])


def _motion(found, number_, arguments, name, ids):
    kind = "revolute" if "ROTATIONAL" in arguments else "prismatic"
    assert not {"VELOCITY", "ACCELERATION"} & set(arguments)
    found.motions[name or number_] = (ids["joints"][arguments["JOINT"][0]], kind, arguments["FUNCTION"])


def _spline(found, number_, arguments, name, ids):
    x, y = (tuple(number(value) for value in arguments[key]) for key in "XY")
    assert len(x) == len(y) >= 4 and all(b > a for a, b in pairwise(x))
    found.splines[number_] = (x, y)


def _variable(found, number_, arguments, name, ids):
    found.variables[number_] = arguments["FUNCTION"]


def _sforce(found, number_, arguments, name, ids):
    assert "ROTATIONAL" in arguments and "ACTIONONLY" not in arguments
    found.forces[name or number_] = ("revolute", arguments["I"][0], arguments["J"][0], arguments["FUNCTION"])


def _vforce(found, number_, arguments, name, ids):
    assert found.markers[arguments["JFLOAT"][0]].frame is None, "JFLOAT must float"
    reaction, reference = found.markers[arguments["JFLOAT"][0]].part, arguments["RM"][0]
    assert found.markers[reference].part == reaction, "this reader knows forces along axes of the reaction's part only"
    assert float(arguments["FX"]) == float(arguments["FY"]) == 0.0
    found.forces[name or number_] = ("prismatic", arguments["I"][0], reference, arguments["FZ"])


def _request(found, number_, arguments, name, ids):
    names = [value.strip('"') for value in arguments["CNAMES"]]
    functions = {key: value for key, value in arguments.items() if re.fullmatch(r"F[1-8]", key)}
    found.requests[name] = {names[int(key[1]) - 1]: value for key, value in functions.items()}


def _nothing(found, number_, arguments, name, ids):
    """Of outputs and the integrator no mechanics depends."""


STATEMENTS = {
    "UNITS": _units, "ACCGRAV": _gravity, "PART": _part, "MARKER": _marker, "JOINT": _joint, "MOTION": _motion,
    "SPLINE": _spline, "VARIABLE": _variable, "SFORCE": _sforce, "VFORCE": _vforce, "REQUEST": _request,
    "OUTPUT": _nothing, "RESULTS": _nothing, "INTEGRATOR": _nothing,
}  # fmt: skip
