from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.export.exported import export_model, write_exported


@pytest.mark.parametrize("arm", ["scara", "panda"])
def test_armature_friction_damping_and_rotors_are_set(models, readers, tmp_path, arm):
    found = models[arm, True]
    robot, n = found.robot, found.robot.n
    write_exported(found, export_model(found, "pinocchio"), tmp_path, "x.json")
    (code,) = (readers.module(path) for path in tmp_path.glob("*_pinocchio.py"))
    model = code.load()
    assert list(model.names)[1:] == [robot.joints[k] for k in np.argsort(robot.order)]
    armature = found.standard[10 * n :]
    np.testing.assert_array_equal(model.armature[robot.order], armature)
    rotors = model.rotorInertia * model.rotorGearRatio**2
    np.testing.assert_allclose(rotors[robot.order], armature, rtol=1e-14)
    assert np.all(model.damping > 0.0) and np.all(model.upperDryFrictionLimit >= 0.0)
    np.testing.assert_array_equal(model.lowerDryFrictionLimit, -model.upperDryFrictionLimit)
    q, v = code.configuration(model, np.full(n, 0.3)), np.full(n, 0.7)
    torque = pin.rnea(model, model.createData(), q, v, np.zeros(n))
    lost = code.inverse_dynamics(model, model.createData(), q, v, np.zeros(n)) - torque
    np.testing.assert_allclose(lost, 0.7 * model.damping + model.upperDryFrictionLimit, rtol=1e-9)


def test_a_continuous_joint_takes_its_angle(models, readers, tmp_path):
    write_exported(models["scara", False], export_model(models["scara", False], "pinocchio"), tmp_path, "x.json")
    code = readers.module(tmp_path / "scara03_pinocchio.py")
    model = pin.Model()
    model.addJoint(0, pin.JointModelRUBZ(), pin.SE3.Identity(), code.JOINTS[0])
    model.addJoint(1, pin.JointModelRZ(), pin.SE3.Identity(), code.JOINTS[1])
    q = code.configuration(model, [2.0, -1.0])
    np.testing.assert_allclose(q, [np.cos(2.0), np.sin(2.0), -1.0])
    np.testing.assert_allclose(code._angles(model, q), [2.0, -1.0])
