"""An identified model as a Python module of CasADi functions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

from scara_ident.export.code import constants, docstring, function, inputs_of, numbers
from scara_ident.export.traced_model import TracedModel

_TEXT = '''\
{doc}
import casadi as ca

{constants}
N = len(JOINTS)


def functions(smooth=0.0):
    """Return the model as CasADi functions by name.

    inverse_dynamics(q, v, a) -> tau, forward_dynamics(q, v, tau) -> a, mass(q) -> M, bias(q, v) -> h and
    friction(q, v, a) -> f with tau = M a + h + f; inverse_derivatives(q, v, a) -> dtau_dq, dtau_dv, dtau_da and
    forward_derivatives(q, v, tau) -> da_dq, da_dv, da_dtau. CasADi differentiates all of them further.

    `smooth` is the speed (rad/s or m/s) over which friction changes its sign, as tanh(v / smooth), for solvers that need
    derivatives at rest; 0 is the model itself.
    """
    q, v, a, tau = (ca.SX.sym(name, N) for name in ("q", "v", "a", "tau"))
    if smooth:
        sign = lambda x: ca.tanh(x / smooth)
    else:
        sign = ca.sign
    torque = ca.vertcat(*_torque(q, v, a, sign))
    mass = ca.reshape(ca.vertcat(*_mass(q, v, a, sign)), N, N).T
    bias = ca.vertcat(*_bias(q, v, a, sign))
    friction = ca.vertcat(*_friction(q, v, a, sign))
    inverse = ca.Function("inverse_dynamics", [q, v, a], [torque], ["q", "v", "a"], ["tau"])
    side = ca.DM(SIDE)
    # Mirrored, so that the factorisation sees one number where there is one.
    symmetric = ca.triu2symm(ca.triu(mass / ca.repmat(side, 1, N)))
    d, lt, order = ca.ldl(symmetric)

    def solved(torque):
        return ca.ldl_solve(torque / side, d, lt, order)

    if FRICTION_BY_ACCELERATION:
        begin = solved(tau - bias - ca.substitute(friction, a, ca.DM.zeros(N)))
        guess = ca.Function("guess", [q, v, tau], [begin])
        given = ca.vertcat(q, v, tau)
        equation = ca.Function("equation", [a, given], [torque - tau])
        newton = ca.rootfinder("newton", "newton", equation, {{"abstol": 1e-12, "max_iter": 50}})
        x, y, z = (ca.MX.sym(name, N) for name in ("q", "v", "tau"))
        found = newton(guess(x, y, z), ca.vertcat(x, y, z))
    else:
        x, y, z, found = q, v, tau, solved(tau - bias - friction)
    forward = ca.Function("forward_dynamics", [x, y, z], [found], ["q", "v", "tau"], ["a"])

    def derivatives(name, states, value, labels, what):
        parts = [ca.jacobian(value, state) for state in states]
        return ca.Function(name, states, parts, labels, [f"d{{what}}_d{{label}}" for label in labels])

    result = [
        inverse,
        forward,
        ca.Function("mass", [q], [mass], ["q"], ["M"]),
        ca.Function("bias", [q, v], [bias], ["q", "v"], ["h"]),
        ca.Function("friction", [q, v, a], [friction], ["q", "v", "a"], ["f"]),
        derivatives("inverse_derivatives", [q, v, a], torque, ["q", "v", "a"], "tau"),
        derivatives("forward_derivatives", [x, y, z], found, ["q", "v", "tau"], "a"),
    ]
    return {{item.name(): item for item in result}}


sin, cos, exp, fabs, tanh = ca.sin, ca.cos, ca.exp, ca.fabs, ca.tanh


{functions}
'''


def casadi_module(model: TracedModel, about: Sequence[str] = ()) -> str:
    """Write a model as a Python module that depends on CasADi alone.

    Parameters
    ----------
    about : sequence of str, optional
        What the reader of the file should know, one line each.
    """
    robot = model.robot
    values = {
        "JOINTS": (robot.joints, "in the order of q, v, a and tau"),
        "SIDE": (numbers(robot.row_scale), f"recorded torque, {robot.effort_side} side, per torque at the joint"),
        "GAIN": (numbers(robot.effort_gain), "torque per unit of the recorded effort"),
        "FRICTION_BY_ACCELERATION": ("a" in inputs_of(model.trace, model.friction, robot.n), "as where it grows with load"),
    }  # fmt: skip
    parts = (
        ("_torque", "The torque as it was recorded.", model.torque),
        ("_mass", "Row by row.", tuple(chain.from_iterable(model.mass))),
        ("_bias", "Coriolis, centrifugal and gravity torque of the links.", model.bias),
        ("_friction", "All else: friction, offset, effects.", model.friction),
    )
    code = [
        function(name, said, model.trace, outputs, robot.n).replace("(q, v, a):", "(q, v, a, sign):")
        for name, said, outputs in parts
    ]
    return _TEXT.format(
        doc=docstring(f"Dynamics of {robot.name} for CasADi, by scara-ident: `functions()`.", about),
        constants=constants(values),
        functions="\n\n\n".join(code),
    )
