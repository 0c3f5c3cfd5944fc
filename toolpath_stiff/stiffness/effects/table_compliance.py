"""Table compliance: the workpiece's side of the loop gives way."""

from toolpath_stiff.arrays import FloatArray
from toolpath_stiff.stiffness.contract import (
    EXPERIENCE,
    Effect,
    LoadPath,
    Values,
    at_the_tip,
    body_on_springs,
    compliance,
    rocking,
)

BUILT = f"{EXPERIENCE}: machine beds are built for 100 to 500 N/um"
LEVER = f"{BUILT} at a lever of about 1 m"


class TableCompliance(Effect):
    """The table shifts along X, Y, Z and rocks about X and Y through the base frame's origin.

    The tip's force F at p acts on the table with the moment p x F about the origin; rocking by c_t (p x F) moves the
    work at p by c_t (p x F) x p. For a horizontal force at height h on the axis that is h^2 c_t.
    """

    name = "table_compliance"
    title = "the table gives way under the work"
    link = "table"
    holds_for = "all"
    equation = "c += d^T diag(c_x, c_y, c_z) d + c_t ((p x d)_x^2 + (p x d)_y^2)"
    source = "springs in series, base axes"
    clause = "the table gives way by about {sizes}"
    parts = (*((axis, f"nm/N along {axis.upper()}") for axis in "xyz"), ("rocking", "nrad/(N m) in rocking"))
    parameters = (
        *(
            compliance(axis, 200.0, (2.0, 10.0), BUILT, f"compliance of the table along {axis.upper()}")
            for axis in "xyz"
        ),
        rocking("rocking", LEVER, "rotation about X and Y per moment"),
    )

    def load_compliance(self, path: LoadPath, p: Values) -> FloatArray | None:
        """Quadratic form of the tip force, in base axes."""
        return at_the_tip(path, body_on_springs(path, (p["x"], p["y"], p["z"]), p["rocking"]))
