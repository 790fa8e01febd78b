"""Laws in C: the same numbers as their Python text gives, or a refusal that says what cannot be said."""

import ctypes
import math
import subprocess

import numpy as np
import pytest

from mbexport.backends.c_text import DOUBLE, Signature, UntranslatableError, array, c_function
from mbexport.backends.fmu_unit import compiler

ARGUMENTS = {"p": array("8"), **dict.fromkeys(("t", "theta", "dtheta", "q", "dq", "load"), DOUBLE)}
SIGNATURE = Signature("law", ARGUMENTS, DOUBLE)
SCALE = -2.5


def branches(p, t, theta, dtheta, q, dq, load):
    """Everything that a law may use."""
    sign = 1.0 if dtheta > 0 else -1.0
    if 0.0 < abs(dtheta) <= p[0] and not load > 1e9:
        value = p[1] * (dtheta / p[0]) ** 2
    elif dtheta < -p[0] or (q > 0.3 and t >= 0):
        value = p[1]
        value -= 0.1
    else:
        value = SCALE * math.exp(-(dtheta * dtheta)) + math.pi
    total = 0.0
    for i in range(1, 4):
        total += math.sin(i * theta) / i
        if total > 1.5:
            break
    k = 0
    while k < 2:
        k += 1
        total *= 0.5
    wrapped = theta % 1.5 - (theta // 0.7) * 1e-3
    return sign * max(value, min(total, p[2], 0.2)) + wrapped + 7 / 2 + 7 // 2 + math.copysign(p[3], dq) + +load


def floors(wert, zeit, a, b, c, d, e):
    return math.floor(a * 3.0) + math.atan2(b, c) + wert[1] * int(d) + (-e if math.isfinite(zeit) else 0.0)


@pytest.mark.skipif(compiler() is None, reason="the C text is compared by running it, which takes a C compiler")
@pytest.mark.parametrize("law", [branches, floors])
def test_c_gives_what_python_gives(law, tmp_path):
    helpers = """#include <math.h>
#include <stdlib.h>
static double larger(double a, double b) { return b > a ? b : a; }
static double smaller(double a, double b) { return b < a ? b : a; }
static double modulo(double a, double b)
{ double r = fmod(a, b); return r != 0.0 && (r < 0.0) != (b < 0.0) ? r + b : r; }
"""
    text = c_function(law, SIGNATURE).replace("static double law", "double law")
    (tmp_path / "law.c").write_text(helpers + text)
    command = [compiler(), "-std=c99", "-O1", "-ffp-contract=off", "-fPIC", "-shared", "-o", "law.so", "law.c", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    compiled = ctypes.CDLL(str(tmp_path / "law.so")).law
    compiled.restype = ctypes.c_double
    random = np.random.default_rng(1)
    for _ in range(300):
        p, state = random.normal(size=8), random.normal(size=6).tolist()
        found = compiled((ctypes.c_double * 8)(*p), *map(ctypes.c_double, state))
        assert found == pytest.approx(law(p, *state), rel=1e-14, abs=1e-14)


def lists(p, t, theta, dtheta, q, dq, load):
    return sum([theta, q])


def powers(p, t, theta, dtheta, q, dq, load):
    return np.power(theta, 2)


def keeps(p, t, theta, dtheta, q, dq, load):
    p[-1] = theta
    return 0.0


def two(p, t):
    return p[0]


@pytest.mark.parametrize(
    "law, said",
    [(lists, "sum"), (powers, "np.power"), (keeps, "p[-1]"), (two, "2 arguments"), (math.sin, "cannot be read")],
)
def test_what_has_no_form_in_c_is_said(law, said):
    with pytest.raises(UntranslatableError) as error:
        c_function(law, SIGNATURE)
    assert said in str(error.value)
