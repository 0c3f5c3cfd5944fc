"""Frame compliance: the vertices that the struts hang from give way."""

from functools import lru_cache

import numpy as np

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import EXPERIENCE, Effect, LoadPath, Parameter, Values, compliance
from toolpath_stiff.stiffness.sizes import sizes_in_words

NUMBERED = "numbered by the lowest strut that they hold"
BUILT = f"{EXPERIENCE}: stiff machine frames are built for 100 to 500 N/um"


class FrameCompliance(Effect):
    """Each vertex of the frame is a node on a radial and a vertical spring; it carries the forces of two struts.

    The tangential direction is taken as rigid: 3 nm/N there adds 0.08 % to the tip's compliance (root mean square over
    the paper's readings), 0.4 % at most at z = 800 mm and 0.6 % in the corners of the upper plane.
    """

    name = "frame_compliance"
    title = "frame vertices give way"
    link = "frame"
    equation = "c += sum_v F_v^T diag(c_r, 0, c_z) F_v, F_v = f_i u_i + f_j u_j in the vertex's cylindrical axes"
    source = "springs in series; the octahedral frame's vertices carry two struts each"
    parameters = (
        Parameter("vertex", "", 1.0, (0, 3), (0, 3), NUMBERED, 0.0, "which vertex; 0 is all three", "integer"),
        compliance("radial", 200.0, (2.0, 10.0), BUILT, "compliance of a vertex towards the machine's axis"),
        compliance("vertical", 200.0, (2.0, 10.0), BUILT, "compliance of a vertex up and down"),
    )

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the six strut forces, coupling the two of each vertex."""
        form = np.zeros((len(path), 12, 12))
        for number, (pair, radial) in enumerate(frame_vertices(path.machine.frame_joints), start=1):
            if p["vertex"] in (0, number):
                carried = np.zeros((len(path), 2, 12))  # outward and upward pull of the two struts
                carried[:, 0, pair] = path.struts.directions[:, pair] @ radial
                carried[:, 1, pair] = path.struts.directions[:, pair, 2]
                form += np.einsum("k,nki,nkj->nij", [p["radial"], p["vertical"]], carried, carried)
        return form

    def vertex_displacement(self, path: LoadPath, p: Values, forces: FloatArray, vertex: int) -> FloatArray | None:
        """Displacement by the vertex's own two springs under the pull of its two struts."""
        if p["vertex"] not in (0, vertex):
            return None
        struts, radial = frame_vertices(path.machine.frame_joints)[vertex - 1]
        pull = np.einsum("nk,nki->ni", forces[:, struts], path.struts.directions[:, struts])
        moved = p["radial"] * (pull @ radial)[:, None] * radial
        moved[:, 2] += p["vertical"] * pull[:, 2]
        return np.asarray(moved)

    def finding(self, p: Values) -> str:
        """Clause on which vertex gives way, and by how much."""
        sizes = sizes_in_words([(p["radial"], "nm/N radially"), (p["vertical"], "nm/N vertically")])
        which = f"frame vertex {p['vertex']} gives" if p["vertex"] else "all three frame vertices give"
        return f"{which} way by about {sizes}"


def frame_vertices(frame_joints: FloatArray) -> list[tuple[list[int], FloatArray]]:
    """The three vertices: the two struts (from 0) of each and its radial unit vector, by lowest strut.

    Joints that are neighbours in angle about the centre share a vertex; of the two ways to pair six joints so, the
    one that holds the joints closer together.
    """
    return _vertices(np.asarray(frame_joints, dtype=float).tobytes())


@lru_cache(maxsize=64)  # a fit evaluates the same frame at every size
def _vertices(joints: bytes) -> list[tuple[list[int], FloatArray]]:
    """`frame_vertices` of six joints; read-only."""
    frame_joints = np.frombuffer(joints).reshape(6, 3)
    from_centre = frame_joints - frame_joints.mean(axis=0)
    order = np.argsort(np.arctan2(from_centre[:, 1], from_centre[:, 0]), kind="stable")
    pairings = [np.roll(order, -start).reshape(3, 2) for start in (0, 1)]
    apart = [np.linalg.norm(np.diff(frame_joints[pairs], axis=1), axis=2).sum() for pairs in pairings]
    pairs = sorted(sorted(pair) for pair in pairings[int(np.argmin(apart))].tolist())
    outward = [from_centre[pair].sum(axis=0) * np.array([1.0, 1.0, 0.0]) for pair in pairs]
    return [(pair, radial / np.linalg.norm(radial)) for pair, radial in zip(pairs, outward, strict=True)]
