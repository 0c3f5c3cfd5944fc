"""A fit as a machine: its fitted values, their uncertainty, and their origin."""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import replace
from importlib import resources

import numpy as np

from toolpath_stiff.documents import Document
from toolpath_stiff.files import read_bytes
from toolpath_stiff.inference.evidence import Fit
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.machine.elements import TORSION
from toolpath_stiff.machine.error_model import ErrorModel
from toolpath_stiff.machine.file import parse_machine
from toolpath_stiff.machine.model import EffectEntry, Hexapod, MachineTool, StrutLaw, Uncertainty
from toolpath_stiff.machine.writer import elements_toml
from toolpath_stiff.readings.measurements import NIST_TABLE_1
from toolpath_stiff.stiffness.contract import ELEMENT, SETUP
from toolpath_stiff.units import n_per_um_from_n_per_m
from toolpath_stiff.workbooks import split_name

LOADING_DIGITS = 6  # digits of standard deviations on which all processors agree


def data_hash(files: Sequence[str]) -> str:
    """SHA-256 of the measurement files' bytes, one after the other."""
    digest = hashlib.sha256()
    packaged = resources.files("toolpath_stiff") / "data" / "nist_table1.csv"
    for file in files:
        paper = file == NIST_TABLE_1
        digest.update(packaged.read_bytes() if paper else read_bytes(split_name(file)[0], "measurements"))
    return digest.hexdigest()


def fitted_machine(
    machine: Hexapod,
    fit: Fit,
    provenance: Document,
    widened: float = 1.0,
    setups: Iterable[str] = (),
    errors: ErrorModel | None = None,
    known: Fit | None = None,
) -> Hexapod:
    """The machine with a fit's strut law and effects, their joint uncertainty, and their origin.

    Parameters
    ----------
    machine
        What was fitted.
    fit
        Effects on top of the machine's own, and the strut law if that was free.
    provenance
        Keys and values for machine files, the same for every entry.
    widened
        Factor on the standard deviations.
    setups
        Names of the set-ups that were measured: where an effect belongs to one, the machine file lists them all.
    errors
        Of the fit, for bands.
    known
        The fit that says how well law and sizes are known; None: the same.
    """
    effects, instruments = entries_of(machine, fit, provenance)
    # Factors of the fitted law, rounded to digits on which all processors agree.
    law = scaled_law(machine.strut_law, np.round(fit.law, 8))
    named = machine.setups
    if any(SETUP in active.waits_for for active in fit.effects):
        named = (*named, *sorted({*setups} - {"", *named}))
    carrying = machine.with_changes(
        effects=effects,
        instruments=instruments,
        setups=named,
        uncertainty=uncertainty_of(machine, fit, known or fit, widened, errors, law),
    )
    if not fit.law_free:
        return carrying
    remark = f"fitted: {provenance['command']}; data sha256 {provenance['data_sha256']}"
    return carrying.with_changes(
        strut_law=law,
        origins={**machine.origins, "strut_law": "fitted"},
        remarks={**machine.remarks, "strut_law": remark},
    )


def entries_of(
    machine: MachineTool, fit: Fit, provenance: Document, first: int = 0
) -> tuple[tuple[EffectEntry, ...], tuple[EffectEntry, ...]]:
    """Effects and instruments of the machine followed by those of a fit, the latter from candidate number `first`."""
    effects, instruments = list(machine.effects), list(machine.instruments)
    for candidate, active in zip(fit.candidates[first:], fit.effects[first:], strict=True):
        in_file = {
            p.key: active.values[p.name] if p.discrete else _certain(float(active.values[p.name]) / p.si)
            for p in candidate.effect.parameters
        }
        (instruments if candidate.effect.is_instrument else effects).append(
            EffectEntry(candidate.name, in_file, dict(provenance))
        )
    return tuple(effects), tuple(instruments)


def fitted_elements(
    machine: MachineTool, fit: Fit, provenance: Document, widened: float, torsions: Sequence[float]
) -> MachineTool:
    """A machine of elements with fitted torsions of its joints, nrad/(N m), and the other effects of a fit.

    `torsions`: of the fit's first candidates; none where these are not fitted.
    """
    effects, instruments = entries_of(machine, fit, provenance, len(torsions))
    names = [entry.name for entry in (*effects, *instruments)]
    carrying = machine.with_changes(effects=effects, instruments=instruments)
    if len(set(names)) == len(names):  # otherwise a name would stand for two of them
        known = uncertainty_of(machine, fit, fit, widened, None, torsions=len(torsions))
        carrying = carrying.with_changes(uncertainty=known)
    return parse_machine(elements_toml(carrying, torsions), machine.name)


def _certain(value: float) -> float:
    """A fitted number rounded to digits on which all processors agree: far more than any fit determines."""
    return float(f"{value:.7g}")


def uncertainty_of(
    machine: MachineTool,
    fit: Fit,
    known: Fit,
    widened: float,
    errors: ErrorModel | None,
    law: StrutLaw | None = None,
    torsions: int = 0,
) -> Uncertainty | None:
    """Joint uncertainty of the fitted values, in the units of their keys, added to that of the machine file.

    The fit's first candidates are so many `torsions` of joints, in place of the file's.
    """
    names = list(law.parameters) if law and known.law_free else []
    slopes = [n_per_um_from_n_per_m(k) for k in ((law.stiffness_1, law.stiffness_2) if law else ())][: len(names)]
    rows = [0, 1][: len(names)]
    owners = [(i, candidate.name) for i, candidate in enumerate(fit.candidates) for _ in candidate.components]
    for index, ((owner, name), (component, size)) in enumerate(zip(owners, fit.parts, strict=True)):
        if index in fit.free:
            joint = str(dict(fit.candidates[owner].choice).get(ELEMENT))
            names.append(joint + TORSION if owner < torsions else f"{name}.{component.parameter.key}")
            # value = 1 / size for a stiffness whose neutral value is infinite.
            slopes.append((-1.0 / size**2 if component.inverse else 1.0) / component.parameter.si)
            rows.append(2 + known.free.index(index))
    if not names:
        return machine.uncertainty
    scale = widened * np.array(slopes)
    fitted = Uncertainty.of(names, np.outer(scale, scale) * known.covariance[np.ix_(rows, rows)])
    sd = np.array([_certain(float(sd)) for sd in fitted.sd])
    if errors is not None:
        of_keys = np.array(slopes) / np.where(sd > 0.0, sd, np.inf)
        loadings, learned = of_keys[:, None] * errors.loadings[rows], np.round(errors.learned, LOADING_DIGITS)
        errors = replace(errors, loadings=np.round(loadings, LOADING_DIGITS), learned=learned)
    certain = replace(fitted, sd=sd, correlation=np.round(fitted.correlation, 9), errors=errors)
    kept = None if machine.uncertainty is None else machine.uncertainty.without(names)
    return kept.beside(certain) if kept and kept.names else certain
