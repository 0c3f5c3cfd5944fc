"""Effects set by hand: the error of every reading at once, and the machine that carries them."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from toolpath_stiff.api.machines import Machine
from toolpath_stiff.api.measurements import Data
from toolpath_stiff.api.question import Noise, Question
from toolpath_stiff.documents import Document
from toolpath_stiff.inference.candidates import Candidate, Component
from toolpath_stiff.inference.element_predictor import predictor_of
from toolpath_stiff.inference.errors import deviation_percent, error_figures
from toolpath_stiff.inference.evidence import Fit, Problem
from toolpath_stiff.inference.fits import fit_effects
from toolpath_stiff.inference.noise import noise_models
from toolpath_stiff.inference.prediction import scaled_law
from toolpath_stiff.machine.model import EffectEntry, Hexapod, StrutLaw
from toolpath_stiff.stiffness.active import read_parameters
from toolpath_stiff.stiffness.catalogue import find_effect
from toolpath_stiff.units import n_per_mm_from_n_per_m


class Preview:
    """The error at every reading with effects of any size, in milliseconds, as for a slider; made by `preview`.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> hand = tps.preview("nist-table1", "nist", noise_percent=5)
    >>> sorted(hand.at({}))
    ['bias_percent', 'deviation_percent', 'mean_abs_error_percent', 'modelled_N_per_mm', 'rms_percent']
    >>> hand.machine({"weak_strut": {"strut": 4, "factor": 0.8}})
    <Machine nist: 6 struts, weak_strut>
    """

    def __init__(self, question: Question) -> None:
        data, given = question.readings, question.common
        # The noise model that a diagnosis reports in full.
        noise = max(noise_models(data, given["noise"], given["strut_spread"]), key=lambda noise: noise.typical)
        self._problem = Problem.of(predictor_of(question.model, data, question.on.effect_files), noise)
        self._on, self._model = question.on, question.model
        self._near: tuple[Mapping[str, Document], Fit] | None = None

    def machine(self, effects: Mapping[str, Document]) -> Machine:
        """The machine with these effects and the strut law refitted beside them; arguments and errors as of `at`."""
        struts = self._model.strut_law if isinstance(self._model, Hexapod) else None
        return with_effects(self._on, effects, struts and scaled_law(struts, self._fit(effects).law))

    def at(
        self,
        effects: Mapping[str, Document] | None = None,
        *,
        strut_law: bool = True,
        near: Mapping[str, Document] | None = None,
    ) -> Document:
        """Errors in per cent with these effects beside those of the machine file.

        Parameters
        ----------
        effects
            Name -> the keys of its entry in a machine file: {"weak_strut": {"strut": 4, "factor": 0.8}}.
        strut_law
            Refit the strut law beside them, as an update writes it; otherwise it stays that of the machine file.
        near
            Effects of other sizes, whose wild readings are taken for wild here too: quicker, for thousands of readings
            while a slider moves. Unless given, wild readings are found anew.

        Returns
        -------
        dict
            "mean_abs_error_percent", "bias_percent", "rms_percent"; "deviation_percent", one a reading, of
            (measured - modelled) / modelled; "modelled_N_per_mm", one a reading.

        Raises
        ------
        InputError
            An effect is unknown, or cannot have such values.
        """
        fit = self._fit(effects or {}, strut_law, None if near is None else self._fit_near(near))
        modelled = n_per_mm_from_n_per_m(np.exp(self._problem.observed - fit.residual))
        return {
            **error_figures(fit.residual),
            "deviation_percent": deviation_percent(fit.residual).tolist(),
            "modelled_N_per_mm": modelled.tolist(),
        }

    def _fit_near(self, effects: Mapping[str, Document]) -> Fit:
        """The fit with these effects; the last one is cached."""
        wanted = {name: dict(keys) for name, keys in effects.items()}
        if self._near is None or self._near[0] != wanted:
            self._near = (wanted, self._fit(wanted))
        return self._near[1]

    def _fit(self, effects: Mapping[str, Document], law_free: bool = True, near: Fit | None = None) -> Fit:
        """The fit of the strut law with effects of these sizes, or with the law kept.

        With `near`, a fit of other sizes: from its law on and with its wild readings, as finding these takes most of
        the time where readings are many.
        """
        candidates, sizes = [], []
        for entry in _entries(effects):
            effect = find_effect(entry.name, self._problem.predictor.effect_files)
            values = read_parameters(effect, entry, "by hand")
            real = tuple(Component.of(p) for p in effect.parameters if not p.discrete)
            discrete = tuple((p.name, values[p.name]) for p in effect.parameters if p.discrete)
            candidates.append(Candidate(effect, discrete, real))
            sizes.append(np.array([component.size(values[component.parameter.name]) for component in real]))
        if near is not None:
            return fit_effects(self._problem, candidates, sizes, (), near.law, near.scatter, law_free)
        # As an update writes it: beside no offsets of struts and joints, which are not written with it.
        scatter, covariance = self._problem.scatter, self._problem.scatter.covariance
        scatter = replace(scatter, covariance=replace(covariance, shared=covariance.shared[:0]))
        fit = fit_effects(self._problem, candidates, sizes, (), np.zeros(2), scatter, law_free)
        again = scatter.with_wild(fit.residual)
        if law_free and again.wild != fit.scatter.wild:
            fit = fit_effects(self._problem, candidates, sizes, (), fit.law, again, law_free)
        return fit


def with_effects(machine: Machine, effects: Mapping[str, Document], strut_law: StrutLaw | None = None) -> Machine:
    """A machine with further effects (name -> keys of the entry in a machine file) and, if given, another strut law."""
    entries, stated = _entries(effects), machine.stated
    read = [entry for entry in entries if find_effect(entry.name, machine.effect_files).is_instrument]
    carried = {
        "effects": (*stated.effects, *(entry for entry in entries if entry not in read)),
        "instruments": (*stated.instruments, *read),
    }
    law = {} if strut_law is None else {"strut_law": strut_law}
    return machine.carrying(stated.with_changes(**carried, **law))


def _entries(effects: Mapping[str, Document]) -> list[EffectEntry]:
    """Effects as entries of a machine file."""
    return [EffectEntry(name, dict(keys)) for name, keys in effects.items()]


def preview(
    data: Data,
    machine: Machine | str | Path = "nist",
    *,
    noise_percent: Noise = None,
    strut_spread_percent: float = 1.0,
) -> Preview:
    """Set effects by hand and see the error of every reading: made once, then some milliseconds a setting.

    Arguments and errors as of `compare`.

    Examples
    --------
    >>> import toolpath_stiff as tps
    >>> hand = tps.preview("nist-table1", "nist", noise_percent=5)
    >>> round(hand.at(strut_law=False)["mean_abs_error_percent"], 2)
    9.62
    >>> round(hand.at({"weak_strut": {"strut": 4, "factor": 0.8}})["mean_abs_error_percent"], 2)
    10.04
    """
    return Preview(Question(machine, data, noise_percent, strut_spread_percent, 0))
