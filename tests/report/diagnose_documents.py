"""Diagnoses made up by hand, with the keys of diagnose.json: one a verdict."""

from __future__ import annotations

from typing import Any

EFFECTS = {
    "spindle_compliance": ("spindle, holder and tool give way", "tool"),
    "platform_flexibility": ("platform gives way", "platform"),
    "joint_compliance": ("joints give way", "joints"),
    "joint_moment_stiffness": ("joints resist turning", "joints"),
    "joint_clearance": ("joints have play", "joints"),
    "contact_nonlinearity": ("joints stiffen with load", "joints"),
    "strut_law": ("strut law is curved", "struts"),
    "weak_strut": ("one strut is weak", "struts"),
    "frame_compliance": ("frame gives way", "frame"),
    "table_compliance": ("table gives way", "table"),
    "setup_compliance": ("one set-up gives way", "table"),
    "tool_length_error": ("tool has another length", "geometry"),
    "platform_radius_error": ("platform has another radius", "geometry"),
    "gauge_scale": ("gauge reads wrong", "instrument"),
    "thermal_drift": ("indicator drifts", "instrument"),
}


def candidate(effect: str, held_out: float, probability: float, words: str, **more: Any) -> dict[str, Any]:
    return {
        "effect": effect,
        "title": EFFECTS[effect][0],
        "link": EFFECTS[effect][1],
        "probability": probability,
        "words": words,
        "parameters": {},
        "choice": {},
        "mean_abs_error_percent": held_out * 0.96,
        "held_out_error_percent": held_out,
        "held_out_rms_percent": held_out * 1.27,
        "held_out_gain_in_se": 3.0,
        "adequate": False,
        "eligible": True,
        "remark": "",
    } | more


def size(value: float | None, unit: str, low: float | None, high: float | None) -> dict[str, Any]:
    return {"value": value, "unit": unit, "interval": [low, high]}


RULED_OUT = [
    candidate("tool_length_error", 3.3, 0.0004, "strongly disfavoured", held_out_gain_in_se=3.4),
    candidate("gauge_scale", 3.9, 1e-6, "ruled out", choice={"direction": 3, "setup": ""}, held_out_gain_in_se=2.1,
              parameters={"scale_percent": size(-12.1, "%", -14.0, -9.9)}),
    candidate("joint_moment_stiffness", 4.9, 0.0, "ruled out", held_out_gain_in_se=0.4),
    candidate("weak_strut", 5.0, 0.0, "ruled out", choice={"strut": 3}, held_out_gain_in_se=0.2,
              parameters={"factor": size(0.93, "", 0.85, 1.0)}),
    candidate("frame_compliance", 5.1, 0.0, "ruled out", choice={"vertex": 2}, held_out_gain_in_se=-0.3),
    candidate("platform_flexibility", 5.05, 0.0, "", offered=False, remark="all at zero", held_out_gain_in_se=None),
    candidate("contact_nonlinearity", 4.0, 0.0, "", offered=False, held_out_gain_in_se=1.4,
              parameters={"compliance_nm_per_N": size(200.0, "nm/N", 150.0, None)},
              remark="compliance at its upper bound of 200 nm/N"),
]  # fmt: skip


def common(verdict: str, **more: Any) -> dict[str, Any]:
    names = list(EFFECTS)
    matrix = [[1.0 if i == j else 0.12 + 0.03 * ((i * j) % 5) for j in range(len(names))] for i in range(len(names))]
    for group, value in ((("spindle_compliance", "table_compliance", "gauge_scale"), 0.97),
                         (("joint_clearance", "contact_nonlinearity"), 0.998)):  # fmt: skip
        for a in group:
            for b in group:
                if a != b:
                    matrix[names.index(a)][names.index(b)] = value
    document = {
        "verdict": verdict,
        "text": "",
        "question": "",
        "best": None,
        "portrait": None,
        "not_excluded_text": "",
        "next": [],
        "notes": [],
        "readings": 42,
        "gates": {"simulated_squares": []},
        "baseline": {
            "mean_abs_error_percent": 4.8, "bias_percent": -0.3, "rms_percent": 6.1, "held_out_error_percent": 5.1,
            "held_out_rms_percent": 6.6, "noise_percent": 2.1, "probability": 0.0, "adequate": False,
            "noise_floor_percent": 1.68,
            "as_given": {"mean_abs_error_percent": 4.9, "held_out_error_percent": 4.9},
            "law": {"stiffness_1_N_per_m": 4.5e7, "stiffness_2_N_per_m": 3.1e7},
        },
        "candidates": [],
        "pairs": [],
        "plausible": [],
        "explanations": list(more.get("plausible", [])),
        "why": [],
        "cannot_test": [{"effect": "thermal_drift", "missing": ["time_min"]},
                        {"effect": "setup_compliance", "missing": ["setup"]}],
        "next_measurements": [],
        "by_noise": {"measured": {"verdict": verdict, "plausible": []}},
        "noise": {"name": "measured", "repeat_percent": 1.8, "clamping_percent": 1.1, "strut_spread_percent": 1.0,
                  "origin": "estimated from 144 differences between repeats"},
        "detectable": [
            {"effect": "spindle_compliance", "parameter": "radial", "unit": "nm/N", "size": 0.56, "rms_percent": 1.9,
             "detectable": True},
            {"effect": "spindle_compliance", "parameter": "axial", "unit": "nm/N", "size": 0.24, "rms_percent": 1.2,
             "detectable": True},
            {"effect": "platform_flexibility", "parameter": "bar_stiffness", "unit": "N/m", "size": 1.5e8,
             "rms_percent": 24.0, "detectable": True},
            {"effect": "tool_length_error", "parameter": "error", "unit": "mm", "size": 4.9, "rms_percent": 1.8,
             "detectable": True},
            {"effect": "weak_strut", "parameter": "factor", "unit": "", "size": 0.89, "rms_percent": 2.6,
             "detectable": True},
            {"effect": "joint_compliance", "parameter": "compliance", "unit": "nm/N", "size": None,
             "rms_percent": None, "detectable": False},
        ],
        "confounding": {"effects": names, "matrix": matrix,
                        "sets": [["joint_clearance", "contact_nonlinearity"],
                                 ["spindle_compliance", "table_compliance", "gauge_scale"]]},
        "path": None,
        "loops": {"by_loop": [], "readings": []},
        "assumptions": ["each joint lies within 0.5 mm (standard deviation) of where the machine file has it",
                        "six struts are alike within 1 % (standard deviation)"],
        "warnings": [],
        "seed": 0,
        "machine": "nist",
        "data": ["campaign.csv"],
        "command": "tps diagnose campaign.csv",
    } | more  # fmt: skip
    for judged in document["by_noise"].values():
        judged.setdefault("noise_percent", 2.1)
        judged.setdefault("probability", {})
    return document


def identified() -> dict[str, Any]:
    winner = candidate(
        "spindle_compliance", 1.72, 0.991, "favoured", held_out_gain_in_se=6.2, adequate=True,
        parameters={"radial_nm_per_N": size(5.12, "nm/N", 4.4, 5.9), "axial_nm_per_N": size(2.0, "nm/N", 1.7, 2.4)},
    )  # fmt: skip
    return common(
        "identified",
        text="Spindle, holder and tool give way: radial 5.12 nm/N, axial 2.00 nm/N.",
        candidates=[
            winner,
            candidate("table_compliance", 2.9, 0.006, "strongly disfavoured", held_out_gain_in_se=5.0),
            *RULED_OUT,
        ],
        plausible=["spindle_compliance"],
        why=[
            "Without it the residuals are larger than scatter explains (probability below 0.2 %).",
            "With it they are as scatter would make them (probability 41 %).",
            "The next best, table_compliance, is 165 times less likely.",
        ],
        by_noise={"measured": {"verdict": "identified", "plausible": ["spindle_compliance"]}},
    )


def described() -> dict[str, Any]:
    finding = "the table gives way along X, with the square of y"
    winner = candidate("table_compliance", 1.8, 0.99, "best", held_out_gain_in_se=6.0, adequate=True, finding=finding)
    return common(
        "described",
        text=f"{finding.capitalize()}. This describes the readings, and does not explain them yet.",
        candidates=[winner, *RULED_OUT],
        plausible=["table_compliance"],
        by_noise={"measured": {"verdict": "described", "plausible": ["table_compliance"]}},
        drawn={"effects": ["table_compliance"], "readings_seen": 42, "readings_new": 0, "gain": None, "rival": "",
               "confirmed": False},
    )  # fmt: skip


def ambiguous() -> dict[str, Any]:
    document = common(
        "ambiguous",
        text="Spindle, table or gauge: these data cannot tell them apart.",
        candidates=[
            candidate("spindle_compliance", 1.75, 0.52, "nearly indistinguishable", held_out_gain_in_se=3.1,
                      adequate=True, parameters={"radial_nm_per_N": size(5.1, "nm/N", 3.2, 7.4),
                                                 "axial_nm_per_N": size(0.0, "nm/N", 0.0, 1.2)}),
            candidate("table_compliance", 1.78, 0.41, "nearly indistinguishable", held_out_gain_in_se=3.0,
                      adequate=True, parameters={"x_nm_per_N": size(4.9, "nm/N", 3.0, 7.0),
                                                 "y_nm_per_N": size(5.2, "nm/N", 3.3, 7.2),
                                                 "z_nm_per_N": size(0.0, "nm/N", 0.0, 1.1),
                                                 "rocking_nrad_per_N_per_m": size(0.4, "nrad/N/m", 0.0, 2.0)}),
            candidate("contact_nonlinearity", 2.1, 0.05, "somewhat disfavoured", held_out_gain_in_se=2.2,
                      adequate=True, parameters={"compliance_nm_per_N": size(4.0, "nm/N", 2.0, 6.0)}),
            *RULED_OUT[:6],
        ],
        plausible=["spindle_compliance", "table_compliance", "contact_nonlinearity"],
        why=["All readings were taken with a vertical spindle, along the axes, with one tool: there a soft table and a "
             "soft spindle look the same (canonical correlation 1.00).",
             "Under one load a contact that stiffens looks like a constant compliance."],
        next_measurements=[
            {"x_mm": 0.0, "y_mm": 0.0, "z_mm": 1268.2, "a_deg": 0.0, "b_deg": 20.0, "c_deg": 0.0, "direction": "X",
             "force_N": 1000.0, "tool_extension_mm": 150.0, "why": "spindle against table: 64 % apart"},
            {"x_mm": -300.0, "y_mm": 150.0, "z_mm": 353.0, "a_deg": 15.0, "b_deg": 0.0, "c_deg": 0.0,
             "direction": "Z", "force_N": 500.0, "tool_extension_mm": 0.0, "why": "contact against both: 9 % apart"},
        ],
        by_noise={"low": {"verdict": "identified", "plausible": ["spindle_compliance"]},
                  "high": {"verdict": "ambiguous",
                           "plausible": ["spindle_compliance", "table_compliance", "contact_nonlinearity", "none"]}},
        noise={"name": "low", "repeat_percent": 1.7, "clamping_percent": 1.0, "strut_spread_percent": 1.0,
               "origin": "guessed: nothing in the data tells it"},
        path={"program": "pocket.nc", "load": "radial", "low_N_per_mm": 31200.0, "high_N_per_mm": 38900.0,
              "spread_percent": 22.0},
    )  # fmt: skip
    document["baseline"]["probability"] = 0.02
    return document


def unexplained() -> dict[str, Any]:
    pair = {
        "effects": ["spindle_compliance", "weak_strut"], "probability": 0.03,
        "parameters": {"spindle_compliance": {"radial_nm_per_N": size(3.0, "nm/N", 2.0, 4.0)},
                       "weak_strut": {"factor": size(0.8, "", 0.7, 0.9)}},
        "choice": {"weak_strut": {"strut": 5}}, "mean_abs_error_percent": 2.9, "held_out_error_percent": 3.3,
        "held_out_gain_in_se": 2.0, "adequate": False, "eligible": True,
    }  # fmt: skip
    return common(
        "unexplained",
        text="The residuals are 2.4 times what scatter explains, and no effect or pair of effects removes them.",
        candidates=[
            candidate("tool_length_error", 4.2, 0.3, "", held_out_gain_in_se=1.1, adequate=False,
                      parameters={"error_mm": size(-18.0, "mm", -25.0, -11.0)}),
            *RULED_OUT[1:],
        ],
        pairs=[pair],
        why=["What is left grows with height: 'Z too soft at the upper plane'."],
    )  # fmt: skip


def adequate() -> dict[str, Any]:
    document = common(
        "adequate",
        text="The model with its strut law refitted leaves what scatter explains.",
        candidates=[candidate(name, 1.75 + 0.02 * k, 0.01, "not needed", held_out_gain_in_se=-0.4, adequate=True)
                    for k, name in enumerate(EFFECTS) if name not in ("thermal_drift", "setup_compliance")],
        plausible=["none"],
        why=["Residuals as large or larger would come up by scatter alone in 47 % of such campaigns."],
    )  # fmt: skip
    document["baseline"] |= {"mean_abs_error_percent": 1.66, "held_out_error_percent": 1.7, "probability": 0.87,
                             "adequate": True}  # fmt: skip
    return document


# A document with parts left out is none: `DiagnosisDocument` says what each holds, and pages may rely on it.
ALL = {f.__name__: f for f in (identified, ambiguous, unexplained, adequate)}
