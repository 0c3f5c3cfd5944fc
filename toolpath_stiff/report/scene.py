"""A machine as drawn by the viewer of pages and studio: its bodies at some poses, and the reach of its tip."""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.documents import Document
from toolpath_stiff.machine.elements import Stance
from toolpath_stiff.machine.limits import reach_along
from toolpath_stiff.machine.model import Hexapod, MachineTool
from toolpath_stiff.poses import pose_in_mm
from toolpath_stiff.rotations import rotation_matrices
from toolpath_stiff.units import mm_from_m

MOST_POSES = 300
MERIDIANS, PARALLELS = 36, 9  # lines of the reach boundary


def machine_scene(machine: MachineTool, poses: FloatArray) -> Document:
    """Scene of a machine for the viewer: of a hexapod its joints in mm, for any pose; of other kinds their bodies.

    Parameters
    ----------
    machine
        Of any kind.
    poses
        (n, 6) m and rad, at which bodies are given, evenly chosen of many, where joint values lead there.
    """
    if isinstance(machine, Hexapod):
        frame, platform = (mm_from_m(joints).tolist() for joints in (machine.frame_joints, machine.platform_joints))
        return {"joints": {"frame": frame, "platform": platform, "tool": mm_from_m(machine.reference_tool_length)}}
    poses = poses[np.unique(np.linspace(0, len(poses) - 1, MOST_POSES).astype(int))]
    stance = machine.solve(poses[:, :3], machine.rotation_of(poses[:, 3:]))
    there = np.isfinite(stance.joints).all(axis=1) if stance.joints.size else np.isfinite(stance.position[:, 0])
    turn = np.broadcast_to(np.eye(3) if stance.work_axes is None else stance.work_axes, (len(poses), 3, 3))
    zero = stance.position[:, None] - poses[:, None, :3] @ np.swapaxes(turn, 1, 2)  # zero of the work, in base axes
    bodies = [
        (name, np.round(mm_from_m((points - zero) @ turn)[there], 1).tolist())
        for name, points in _standing(machine, stance)
    ]
    links = {element.name: element.link for element in machine.elements}
    return {
        "bodies": [{"name": name, "link": links.get(name, name)} for name, _ in bodies],
        "poses": [pose_in_mm(pose) for pose in poses[there].tolist()],
        "frames": [list(frame) for frame in zip(*(points for _, points in bodies), strict=True)],
    }


def _standing(machine: MachineTool, stance: Stance) -> list[tuple[str, FloatArray]]:
    """Bodies by name, (n, p, 3) m, base axes: a spindle that ends at the tip is shown, slides get a bed."""
    bodies = {name: points.copy() for name, points in machine.lines(stance)}
    every = np.concatenate([*bodies.values()], axis=1)[0]
    low, high = np.nanmin(every, axis=0), np.nanmax(every, axis=0)
    names, size = [*bodies], 0.2 * float((high - low).max())
    tool, before = bodies["tool"], bodies[names[names.index("tool") - 1]]
    if np.allclose(tool[:, 0], tool[:, 1]):
        tool[:, 0] += size * stance.axes[:, :, 2]
        before[:, -1] = tool[:, 0]
    if names[0] in machine.joint_names or "platform" in bodies:
        return [*bodies.items()]
    base, floor = bodies[names[0]][:, 0].copy(), low[2] - size
    for points in bodies.values():  # bodies that begin at the base's axes stand on the bed
        if np.array_equal(points[:, 0], base):
            points[:, 0] = [*points[0, 1, :2], floor]
    (x, y), (right, back) = low[:2] - size, high[:2] + size
    bed = np.array([[x, y, floor], [right, y, floor], [right, back, floor], [x, back, floor]])
    return [*bodies.items(), ("bed", np.broadcast_to(bed, (len(tool), 4, 3)))]


def reach_boundary(machine: MachineTool) -> list[list[list[float]]]:
    """(parallels, meridians, 3) mm: farthest tip positions along rays from the default origin, unturned."""
    origin = np.array(machine.default_origin)
    heights = np.radians(np.linspace(-90.0, 90.0, PARALLELS))[:, None]
    azimuths = 2.0 * np.pi * np.arange(MERIDIANS) / MERIDIANS
    level = np.cos(heights)
    parts = np.broadcast_arrays(level * np.cos(azimuths), level * np.sin(azimuths), np.sin(heights))
    rays = np.stack(parts, axis=-1).reshape(-1, 3)
    lengths = reach_along(machine, origin[:3], rays, rotation_matrices(origin[3:]))[:, None]
    boundary = np.round(mm_from_m(origin[:3] + lengths * rays), 1).reshape(PARALLELS, MERIDIANS, 3)
    return boundary.tolist()  # type: ignore[no-any-return]
