"""The one least-squares loop against NIST's Statistical Reference Datasets: certified estimates and deviations.

Data and certified values: https://www.itl.nist.gov/div898/strd/ (lls/data/Norris, nls/data/misra1a, danwood, mgh09,
thurber, eckerle4; lower, average and higher level of difficulty). Public domain.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from toolpath_stiff.inference.least_squares import NormalEquations, gauss_newton, scaled_inverse

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Certified:
    """A model y = f(x, b), its data as rows of y and x, where to start; certified b, their sd, sum of squares left."""

    model: Callable[[FloatArray, FloatArray], FloatArray]
    data: str
    start: tuple[float, ...]
    estimate: tuple[float, ...]
    deviation: tuple[float, ...]
    squares: float

    @property
    def columns(self) -> tuple[FloatArray, FloatArray]:
        """Those of x and of y."""
        y, x = np.array(self.data.split(), dtype=float).reshape(-1, 2).T
        return x, y


CASES = {
    "Norris": Certified(
        lambda x, b: b[0] + b[1] * x,
        """0.1 0.2  338.8 337.4  118.1 118.2  888.0 884.6  9.2 10.1  228.1 226.5  668.5 666.3  998.5 996.3  449.1 448.6
        778.9 777.0  559.2 558.2  0.3 0.4  0.1 0.6  778.1 775.5  668.8 666.9  339.3 338.0  448.9 447.5  10.8 11.6
        557.7 556.0  228.3 228.1  998.0 995.8  888.8 887.6  119.6 120.2  0.3 0.3  0.6 0.3  557.6 556.8  339.3 339.1
        888.0 887.2  998.5 999.0  778.9 779.0  10.2 11.1  117.6 118.3  228.9 229.2  668.4 669.1  449.2 448.9
        0.2 0.5""",
        (0.0, 0.0),
        (-0.262323073774029, 1.00211681802045),
        (0.232818234301152, 0.429796848199937e-03),
        26.6173985294224,
    ),
    "Misra1a": Certified(
        lambda x, b: b[0] * (1.0 - np.exp(-b[1] * x)),
        """10.07 77.6  14.73 114.9  17.94 141.1  23.93 190.8  29.61 239.9  35.18 289.0  40.02 332.8  44.82 378.4
        50.76 434.8  55.05 477.3  61.01 536.8  66.40 593.1  75.47 689.1  81.78 760.0""",
        (500.0, 0.0001),
        (2.3894212918e02, 5.5015643181e-04),
        (2.7070075241e00, 7.2668688436e-06),
        1.2455138894e-01,
    ),
    "DanWood": Certified(
        lambda x, b: b[0] * x ** b[1],
        "2.138 1.309  3.421 1.471  3.597 1.490  4.340 1.565  4.882 1.611  5.660 1.680",
        (1.0, 5.0),
        (7.6886226176e-01, 3.8604055871e00),
        (1.8281973860e-02, 5.1726610913e-02),
        4.3173084083e-03,
    ),
    "MGH09": Certified(
        lambda x, b: b[0] * (x**2 + x * b[1]) / (x**2 + x * b[2] + b[3]),
        """0.1957 4  0.1947 2  0.1735 1  0.1600 0.5  0.0844 0.25  0.0627 0.167  0.0456 0.125  0.0342 0.1  0.0323 0.0833
        0.0235 0.0714  0.0246 0.0625""",
        (0.25, 0.39, 0.415, 0.39),
        (1.9280693458e-01, 1.9128232873e-01, 1.2305650693e-01, 1.3606233068e-01),
        (1.1435312227e-02, 1.9633220911e-01, 8.0842031232e-02, 9.0025542308e-02),
        3.0750560385e-04,
    ),
    "Thurber": Certified(
        lambda x, b: np.polyval(b[3::-1], x) / np.polyval([*b[:3:-1], 1.0], x),
        """80.574 -3.067  84.248 -2.981  87.264 -2.921  87.195 -2.912  89.076 -2.840  89.608 -2.797  89.868 -2.702
        90.101 -2.699  92.405 -2.633  95.854 -2.481  100.696 -2.363  101.060 -2.322  401.672 -1.501  390.724 -1.460
        567.534 -1.274  635.316 -1.212  733.054 -1.100  759.087 -1.046  894.206 -0.915  990.785 -0.714  1090.109 -0.566
        1080.914 -0.545  1122.643 -0.400  1178.351 -0.309  1260.531 -0.109  1273.514 -0.103  1288.339 0.010
        1327.543 0.119  1353.863 0.377  1414.509 0.790  1425.208 0.963  1421.384 1.006  1442.962 1.115  1464.350 1.572
        1468.705 1.841  1447.894 2.047  1457.628 2.200""",
        (1300.0, 1500.0, 500.0, 75.0, 1.0, 0.4, 0.05),
        (
            1.2881396800e03, 1.4910792535e03, 5.8323836877e02, 7.5416644291e01, 9.6629502864e-01, 3.9797285797e-01,
            4.9727297349e-02,
        ),
        (
            4.6647963344e00, 3.9571156086e01, 2.8698696102e01, 5.5675370270e00, 3.1333340687e-02, 1.4984928198e-02,
            6.5842344623e-03,
        ),
        5.6427082397e03,
    ),
    "Eckerle4": Certified(
        lambda x, b: b[0] / b[1] * np.exp(-0.5 * ((x - b[2]) / b[1]) ** 2),
        """0.0001575 400  0.0001699 405  0.0002350 410  0.0003102 415  0.0004917 420  0.0008710 425  0.0017418 430
        0.0046400 435  0.0065895 436.5  0.0097302 438  0.0149002 439.5  0.0237310 441  0.0401683 442.5  0.0712559 444
        0.1264458 445.5  0.2073413 447  0.2902366 448.5  0.3445623 450  0.3698049 451.5  0.3668534 453  0.3106727 454.5
        0.2078154 456  0.1164354 457.5  0.0616764 459  0.0337200 460.5  0.0194023 462  0.0117831 463.5  0.0074357 465
        0.0022732 470  0.0008800 475  0.0004579 480  0.0002345 485  0.0001586 490  0.0001143 495  0.0000710 500""",
        (1.5, 5.0, 450.0),
        (1.5543827178e00, 4.0888321754e00, 4.5154121844e02),
        (1.5408051163e-02, 4.6803020753e-02, 4.6800518816e-02),
        1.4635887487e-03,
    ),
}  # fmt: skip


def slopes(case: Certified, x: FloatArray, at: FloatArray) -> FloatArray:
    """(n, p) of the model, by complex steps: exact to rounding (Squire and Trapp 1998, SIAM Review 40, 110)."""
    columns = []
    for j in range(len(at)):
        moved = at.astype(complex)
        moved[j] += 1e-30j
        columns.append(np.asarray(case.model(x, moved)).imag / 1e-30)
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("name", CASES)
def test_certified_estimates_are_found(name):
    """Steps by `scaled_inverse`, halved until the fit gets no worse, as the fits with the model itself take them."""
    case = CASES[name]
    x, y = case.columns

    def squares(at: FloatArray) -> float:
        left = y - case.model(x, at)
        return float(left @ left)

    def equations(at: FloatArray) -> NormalEquations:
        jacobian = slopes(case, x, at)
        return NormalEquations(jacobian, jacobian.T @ jacobian, jacobian.T @ (y - case.model(x, at)))

    def move(at: FloatArray, here: NormalEquations) -> tuple[FloatArray, FloatArray] | None:
        step = scaled_inverse(here.information) @ here.gradient
        for _ in range(20):
            if squares(at + step) <= squares(at) * (1.0 + 1e-12):
                return at + step, step
            step = 0.5 * step
        return None

    found, _ = gauss_newton(np.array(case.start), equations, move, steps=60, tolerance=1e-12)
    variance = squares(found) / (len(y) - len(found))
    deviation = np.sqrt(np.diag(scaled_inverse(equations(found).information)) * variance)
    assert found == pytest.approx(case.estimate, rel=1e-8)
    assert deviation == pytest.approx(case.deviation, rel=1e-6)
    assert squares(found) == pytest.approx(case.squares, rel=1e-9)
