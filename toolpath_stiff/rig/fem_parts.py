"""Parts of the machine of finite elements, each condensed to the points where loads act: frame, platform, table.

Every size is assumed, in proportion to the frame's and the platform's radius.
"""

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.rig import beams
from toolpath_stiff.rig.beams import NODE, add, arm
from toolpath_stiff.rig.nominal import Nominal

FEET = 2e10  # N/m, a foot of the frame in each direction
BEARINGS = (1.5e10, 1.5e10, 2e10, 1.5e9, 1.5e9, 1.5e9)  # N/m and N m/rad of the spindle in the platform
MOUNTS = 2e10  # N/m, each of four mounts of the table in each direction
SLAB = np.repeat([1e11, 1e11], 3)  # N/m and N m/rad, the floor under the table
GRID = 5  # nodes along each side of the table's grillage
STIFFENED = 2.0  # on `nist`: a sound machine is then as the nominal one describes it, within half a per cent
HUB, NOSE, SHAFT, TIP = 6, 7, 8, 9  # nodes of the platform after its six joints


def mean_radius(points: FloatArray) -> float:
    """Mean distance of points (n, 3) from the machine's axis, m."""
    return float(np.linalg.norm(points[:, :2], axis=1).mean())


def scale(nominal: Nominal) -> float:
    """Factor on the stiffness of all parts but the struts, which alone give in the nominal machine."""
    return STIFFENED * float(nominal.law_stiffnesses.mean()) / 39.5e6 * 2.25 / mean_radius(nominal.frame_joints)


def table_top(nominal: Nominal) -> float:
    """Height of the table, m: a third of the frame's radius below the neutral pose."""
    return float(nominal.neutral_pose[2] - 0.355 * mean_radius(nominal.frame_joints))


def frame_corners(nominal: Nominal) -> FloatArray:
    """(v, 3) m, corners of the frame's upper ring: each amid the joints that it holds."""
    return np.array([nominal.frame_joints[nominal.vertices == k].mean(axis=0) for k in range(nominal.corners)])


def frame_stiffness(nominal: Nominal, members: FloatArray, feet: FloatArray, brackets: FloatArray) -> FloatArray:
    """(6 v, 6 v) of an octahedron of square steel on feet, seen at the v corners that hold the struts.

    `members` (4 v or more,) are factors on upper ring, lower ring and diagonals, `feet` (v or more,) on its feet;
    `brackets` (v or more, 2) m/N radial and vertical at the corners.
    """
    corners = frame_corners(nominal)
    order, count, size = np.argsort(np.arctan2(corners[:, 1], corners[:, 0])), len(corners), mean_radius(corners)
    upper = corners[order]
    lower = upper + np.roll(upper, -1, axis=0)
    lower *= size / np.linalg.norm(lower[:, :2], axis=1, keepdims=True)
    lower[:, 2] = min(table_top(nominal), upper[:, 2].min()) - 0.3 * size
    ring = [(k, (k + 1) % count) for k in range(count)]
    pairs = ring + [(count + i, count + j) for i, j in ring]
    pairs += [pair for k, after in ring for pair in ((k, count + k), (after, count + k))]
    nodes = np.concatenate([upper, lower])
    total = beams.beams(nodes, pairs, beams.square(0.18 * size), members[: len(pairs)])
    standing = NODE * (count + np.repeat(np.arange(count), 3)) + np.tile(np.arange(3), count)
    total[standing, standing] += FEET * np.repeat(feet[:count], 3)
    give = np.linalg.inv(beams.condensed(scale(nominal) * total, range(count)))
    for k, (radial, vertical) in enumerate(brackets[order]):
        outward = upper[k, :2] / np.linalg.norm(upper[k, :2])
        give[NODE * k : NODE * k + 2, NODE * k : NODE * k + 2] += radial * np.outer(outward, outward)
        give[NODE * k + 2, NODE * k + 2] += vertical
    back = (NODE * np.argsort(order)[:, None] + np.arange(NODE)).ravel()
    return np.asarray(np.linalg.inv(give)[np.ix_(back, back)])


def platform_stiffness(
    nominal: Nominal, joints: FloatArray, tip: float, rim: FloatArray, spokes: FloatArray, give: FloatArray, tool: float
) -> FloatArray:
    """(48, 48) of rim, spokes, spindle and tool, seen at joints, hub and tip; platform axes.

    `joints` (6, 3) m where they are, `tip` m above the reference tool's; `rim` and `spokes` (6,) factors in
    the order of azimuth; `give` (6, 6) of the spindle beside its sound bearings; `tool` factor on the tool's diameter.
    """
    size = mean_radius(joints)
    hub = max(float(joints[:, 2].mean()), 0.5 * size)
    nose = nominal.tool_length if 0.0 < nominal.tool_length < 0.9 * hub else 0.5 * hub
    heights = np.array([hub, nose, nose, min(tip, 0.8 * nose)])
    nodes = np.concatenate([joints, heights[:, None] * np.array([0.0, 0.0, 1.0])])
    around = np.argsort(np.arctan2(joints[:, 1], joints[:, 0]))
    total = beams.beams(nodes, np.column_stack([around, np.roll(around, -1)]).tolist(), beams.square(size), rim)
    total += beams.beams(nodes, [(int(k), HUB) for k in around], beams.square(size), spokes)
    total += beams.beams(nodes, [(HUB, NOSE)], beams.bar(1.1 * size))
    total += beams.beams(nodes, [(SHAFT, TIP)], beams.bar(0.9 * size * tool))
    total *= scale(nominal)
    sound = np.diag(1.0 / (scale(nominal) * np.array(BEARINGS)))
    add(total, (NOSE, SHAFT), beams.springs(np.asarray(np.linalg.inv(sound + give)), np.zeros(3)))
    return beams.condensed(total, (*range(6), HUB, TIP))


def table_give(nominal: Nominal, points: FloatArray, mounts: FloatArray, plate: float, floor: FloatArray) -> FloatArray:
    """(n, 3, 3) m/N of the table at points (n, 3) above it, where a stiff fixture leads load and indicator.

    `mounts` (4,) and `plate` are factors; `floor` (3,) a rotation vector, root of rad/(N m), about which it tilts.
    """
    half, top = 0.3 * mean_radius(nominal.frame_joints), table_top(nominal)
    ticks = np.linspace(-half, half, GRID)
    nodes = np.array([(x, y, top) for x in ticks for y in ticks] + [(0.0, 0.0, top)])
    grid = np.arange(GRID**2).reshape(GRID, GRID)
    sides = ((grid[:-1], grid[1:]), (grid[:, :-1], grid[:, 1:]))
    pairs = np.concatenate([np.column_stack([a.ravel(), b.ravel()]) for a, b in sides]).tolist()
    total = beams.beams(nodes, pairs, beams.square(half), plate)
    for corner, factor in zip(grid[[0, 0, -1, -1], [0, -1, 0, -1]], mounts, strict=True):
        mount = np.diag([MOUNTS * factor] * 3 + [0.0] * 3)
        add(total, (GRID**2, corner), beams.springs(mount, nodes[corner] - nodes[-1]))
    total *= scale(nominal)
    slab = np.diag(1.0 / (scale(nominal) * SLAB))
    slab[3:, 3:] += np.outer(floor, floor)
    total[-NODE:, -NODE:] += np.linalg.inv(slab)
    reach = np.zeros((len(points), 3, len(nodes), NODE))
    cell = np.clip((points[:, :2] + half) / (ticks[1] - ticks[0]), 0.0, GRID - 1.0)
    first = np.minimum(cell.astype(int), GRID - 2)
    for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):  # bilinear between the four nodes around
        weight = np.prod(np.where([i, j], cell - first, 1.0 - (cell - first)), axis=1)
        node = grid[first[:, 0] + i, first[:, 1] + j]
        reach[np.arange(len(points)), :, node] += weight[:, None, None] * arm(points - nodes[node])[:, :3]
    flat = reach.reshape(len(points), 3, -1)
    return np.asarray(flat @ np.linalg.inv(total) @ np.swapaxes(flat, 1, 2))
