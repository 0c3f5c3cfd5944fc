"""Compliance of serial machines by other programs: pinocchio, MuJoCo, OpenSees. Each may be missing.

All take a chain as joints (place in the frame before, kind) and springs (frame, place in it, compliances). pinocchio
and MuJoCo carry them along the joints themselves; MuJoCo has a joint for each way in which a spring gives, pinocchio
the action of its twist; OpenSees solves a frame of springs and rigid links under loads.
"""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import Any

import numpy as np

from toolpath_stiff.machine.bodies import Body
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.serial import Serial


def sides(machine: Serial):
    """Joints, springs, end in the last frame, numbers of the joints' values; of the tool's and of the work's chain."""
    count, chain = len(machine.tool_joints), machine.chain
    yield machine.tool_joints, machine.tool_bodies, machine.tip, chain[:count]
    yield machine.work_joints, machine.work_bodies, machine.work, chain[count:]


def soft(machine: Serial) -> Serial:
    """The machine with something in every direction of every spring, without beams that span two frames.

    Those no rigid body carries; and a spring that is rigid in some directions is a constraint to OpenSees.
    """
    bodies = {
        side: tuple(
            replace(body, compliance=np.where(body.compliance > 0.0, body.compliance, 2e-9))
            for body in getattr(machine, side)
            if isinstance(body, Body)
        )
        for side in ("tool_bodies", "work_bodies")
    }
    return machine.with_changes(**bodies)


def by_pinocchio(machine: Serial, joints: np.ndarray) -> np.ndarray:
    """(n, 6, 6) compliance of the tip against the work, base axes."""
    pin: Any = importlib.import_module("pinocchio")
    total, tips = np.zeros((len(joints), 6, 6)), None
    for chain, bodies, end, numbers in sides(machine):
        model = pin.Model()
        for joint in chain:
            kind = pin.JointModelPZ() if joint.linear else pin.JointModelRZ()
            place = pin.SE3(joint.place.axes, joint.place.origin)
            model.addJoint(model.njoints - 1, kind, place, joint.name)
        data, stands = model.createData(), []
        for q in joints[:, numbers]:
            pin.forwardKinematics(model, data, np.ascontiguousarray(q))
            stands.append([pin.SE3(frame) for frame in data.oMi] + [data.oMi[-1] * pin.SE3(end.axes, end.origin)])
        if tips is None:
            tips = [frames[-1].translation.copy() for frames in stands]
        for row, (frames, tip) in enumerate(zip(stands, tips, strict=True)):
            from_tip = pin.SE3(np.eye(3), tip).inverse()
            for body in bodies:
                twist = (from_tip * frames[body.frame] * pin.SE3(body.place.axes, body.place.origin)).toActionMatrix()
                total[row] += twist @ np.diag(body.compliance) @ twist.T
    return total


def by_mujoco(machine: Serial, joints: np.ndarray) -> np.ndarray:
    """(n, 6, 6) as of `by_pinocchio`; a spring is a body with six joints, the tip's Jacobian is MuJoCo's."""
    mujoco: Any = importlib.import_module("mujoco")
    total, tips = np.zeros((len(joints), 6, 6)), None
    for chain, bodies, end, numbers in sides(machine):
        text, depth, compliance, moved = "", 0, [], []

        def inside(axes: np.ndarray, origin: np.ndarray) -> str:
            columns = " ".join(f"{v:.17g}" for v in axes[:, :2].T.ravel())
            return f'<body xyaxes="{columns}" pos="{" ".join(f"{v:.17g}" for v in origin)}">'

        inertia, count = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>', 0
        for frame in range(len(chain) + 2):
            place = chain[frame - 1].place if 0 < frame <= len(chain) else end
            if frame:
                text, depth = text + inside(place.axes, place.origin), depth + 1
            if 0 < frame <= len(chain):
                kind = "slide" if chain[frame - 1].linear else "hinge"
                text += f'{inertia}<joint type="{kind}" axis="0 0 1"/>'
                moved.append(count)
                count += 1
            for body in (b for b in bodies if b.frame == frame):
                back = body.place.inverse()
                text += inside(body.place.axes, body.place.origin) + inertia
                text += "".join(f'<joint type="{kind}" axis="{axis}"/>' for kind in ("slide", "hinge")
                                for axis in ("1 0 0", "0 1 0", "0 0 1")) + inside(back.axes, back.origin)  # fmt: skip
                compliance += [(count + i, c) for i, c in enumerate(body.compliance)]
                depth, count = depth + 2, count + 6
        world = f'<worldbody>{text}<site name="end"/>{"</body>" * depth}</worldbody>'
        model = mujoco.MjModel.from_xml_string(f'<mujoco><compiler angle="radian"/>{world}</mujoco>')
        data, places = mujoco.MjData(model), []
        values = np.zeros(model.nv)
        values[[i for i, _ in compliance]] = [c for _, c in compliance]
        for row, q in enumerate(joints[:, numbers]):
            data.qpos[:] = 0.0
            data.qpos[moved] = q
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            jacobian = np.zeros((6, model.nv))
            point = data.site("end").xpos.copy() if tips is None else tips[row]
            places.append(point)
            mujoco.mj_jac(model, data, jacobian[:3], jacobian[3:], point, model.site("end").bodyid[0])
            total[row] += (jacobian * values) @ jacobian.T
        tips = places if tips is None else tips
    return total


def stance_at(machine: Serial, joints: np.ndarray) -> Stance:
    """How it stands at joint values (n, j)."""
    return machine._stance(joints.T, np.zeros(len(joints), dtype=np.int64), np.zeros(()))


def by_opensees(machine: Serial, joints: np.ndarray) -> np.ndarray:
    """(n, 6, 6) as of `by_pinocchio`; springs between two nodes at a place, rigid links between, loads at the tip."""
    stance = stance_at(machine, joints)
    return np.array([_solved(machine, stance, row) for row in range(len(joints))])


def _solved(machine: Serial, stance: Stance, row: int) -> np.ndarray:
    """(6, 6) at one pose."""
    ops: Any = importlib.import_module("openseespy.opensees")
    count, total = len(machine.tool_bodies), np.zeros((6, 6))
    for springs in (stance.loads[:count], stance.loads[count:]):
        if not springs:
            continue
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        last = 0
        for i, spring in enumerate(springs):
            place = spring.place if spring.place.ndim == 1 else spring.place[row]
            axes = np.eye(3) if spring.axes is None else spring.axes if spring.axes.ndim == 2 else spring.axes[row]
            compliance = spring.compliance if spring.compliance.ndim == 1 else spring.compliance[row]
            near, far = 2 * i + 1, 2 * i + 2
            for node in (near, far):
                ops.node(node, *map(float, place))
            if last:
                ops.rigidLink("beam", last, near)
            else:
                ops.fix(near, *[1] * 6)
            for k, value in enumerate(compliance.tolist()):
                ops.uniaxialMaterial("Elastic", 10 * i + k + 1, 1.0 / value)
            ops.element("zeroLength", i + 1, near, far, "-mat", *range(10 * i + 1, 10 * i + 7), "-dir", *range(1, 7),
                        "-orient", *map(float, axes[:, 0]), *map(float, axes[:, 1]))  # fmt: skip
            last = far
        ops.node(9999, *map(float, stance.position[row]))
        ops.rigidLink("beam", last, 9999)
        for k in range(6):
            ops.timeSeries("Constant", k + 1)
            ops.pattern("Plain", k + 1, k + 1)
            ops.load(9999, *[float(i == k) for i in range(6)])
            ops.constraints("Transformation")
            ops.numberer("Plain")
            ops.system("FullGeneral")
            ops.algorithm("Linear")
            ops.integrator("LoadControl", 1.0)
            ops.analysis("Static", "-noWarnings")
            assert ops.analyze(1) == 0
            total[:, k] += [ops.nodeDisp(9999, i + 1) for i in range(6)]
            ops.remove("loadPattern", k + 1)
            ops.reset()
            ops.wipeAnalysis()
    return total


def drawn(machine: Serial, rng: np.random.Generator, count: int) -> np.ndarray:
    """(count, j) joint values within the limits, and within a turn."""
    low, high = np.clip(machine.joint_limits, -3.0, 3.0).T
    return rng.uniform(low, high, (count, len(low)))


ORACLES = {"pinocchio": by_pinocchio, "mujoco": by_mujoco, "openseespy.opensees": by_opensees}


def apart(oracle: str, machine: Serial, joints: np.ndarray) -> float:
    """The largest difference of a compliance, in units of the two directions' own (geometric mean)."""
    compliance = stance_at(machine, joints).tip_compliance()
    own = np.sqrt(np.einsum("nii->ni", compliance))
    difference = ORACLES[oracle](machine, joints) - compliance
    return float(np.abs(difference / (own[:, :, None] * own[:, None, :])).max())
