"""Words and figures of a diagnosis, the same on the terminal, in the pictures and on the page."""

from collections.abc import Sequence

from toolpath_stiff.diagnosis.examination import SHOWN, Diagnosis, FittedSize, HypothesisRow, percent_of
from toolpath_stiff.diagnosis.words import assumptions, beside_text, next_steps, verdict_text, why
from toolpath_stiff.documents import Document, json_number, number
from toolpath_stiff.hints import parted
from toolpath_stiff.inference.errors import scatter_text
from toolpath_stiff.inference.judgement import NONE
from toolpath_stiff.inference.unexcluded import Unexcluded
from toolpath_stiff.portrait.words import portrait_text
from toolpath_stiff.report.tables import ShownTable
from toolpath_stiff.report.words import WIDTH, counted, labelled, machine_text, percent, plain, shortened, significant

HEADLINES = {
    "adequate": "Nothing is missing that these data could show",
    "identified": "One explanation is far likelier than any other",
    "described": "One description fits, read off these very readings: new ones must confirm it",
    "ambiguous": "These data cannot tell several explanations apart",
    "unexplained": "Something is missing, and nothing in the catalogue accounts for it",
}


def probability_text(value: float | None) -> str:
    """A probability from 0 to 1 as per cent; marked if it only rounds to 0 or 100."""
    if value is None:
        return "-"
    if 0.0 < value < 0.005:
        return "< 0.5 %"
    return "> 99.5 %" if 0.995 < value < 1.0 else f"{100.0 * value:.0f} %"


def size_texts(row: HypothesisRow, intervals: bool = True) -> list[str]:
    """Each fitted size in words: "radial 5.12 nm/N (4.40 to 5.90)"; of a pair, preceded by its effect."""
    return [
        plain(f"{effect if len(row.sizes) > 1 else ''} {_size_text(key, size, intervals)}".strip())
        for effect, sizes in row.sizes.items()
        for key, size in sizes.items()
    ]


def _size_text(key: str, size: FittedSize, intervals: bool) -> str:
    """A fitted size in words; `key` as in machine files, `bar_stiffness_N_per_m`, ends with the unit."""
    tail = size.unit.replace("/", "_per_").replace(" ", "_").replace("%", "percent")
    name = (key.removesuffix(f"_{tail}") if tail else key).replace("_", " ")
    text = f"{name} {significant(size.value)} {size.unit}".rstrip()
    low, high = ("no limit" if end is None else significant(end) for end in size.interval)
    return f"{text} ({low} to {high})" if intervals else text


def remark_text(row: HypothesisRow) -> str:
    """Words on how a hypothesis stands, and what is against it."""
    if not row.eligible and (row.probability or 0.0) < SHOWN:
        return plain(row.remark)
    leaves = row.adequate is False and row.words not in ("does not fit", "ruled out")
    return plain("; ".join(filter(None, (row.words, row.remark or ("leaves structure" if leaves else "")))))


def bound_name(hidden: Unexcluded) -> str:
    """Effect and parameter of a bound."""
    return plain(f"{hidden.effect.name} {hidden.parameter.name.replace('_', ' ')}")


def bound_text(hidden: Unexcluded) -> str:
    """The size up to which an effect is not excluded."""
    return plain(f"{significant(json_number(hidden.value / hidden.parameter.si))} {hidden.parameter.unit}".rstrip())


def floor_text(diagnosis: Diagnosis) -> str:
    """Mean error that scatter alone would leave, marked if it is a guess."""
    guess = f" ({diagnosis.noise.guess} guess)" if diagnosis.noise.guess else ""
    return percent(json_number(diagnosis.noise.floor_percent), 2) + guess


def headline(diagnosis: Diagnosis) -> str:
    """The verdict as one sentence, with the cause if one was found."""
    cause, standing = diagnosis.rows.best.finding if diagnosis.rows.best else "", diagnosis.explanations
    if diagnosis.main.question:
        return plain(diagnosis.main.question)
    if cause and diagnosis.verdict in ("identified", "described"):
        unconfirmed = " (described, not confirmed)" if diagnosis.verdict == "described" else ""
        return plain(cause[0].upper() + cause[1:] + unconfirmed)
    if diagnosis.verdict == "ambiguous" and len(standing) == 1:
        return plain(f"{standing[0]} is likeliest, but something else is not ruled out")
    if diagnosis.verdict == "ambiguous" and len({judged.verdict for judged in diagnosis.judgements.values()}) > 1:
        return "It depends on how much the readings scatter, which these data do not tell"
    return HEADLINES[diagnosis.verdict]


_UNTRIED = "--program PART tells how much the choice matters along that program"


def path_text(path: Document | None) -> str:
    """Sentence on how far the plausible explanations differ on a tool path; "" if it was not tried."""
    if path is None:
        return ""
    program = f"{path['program']} in set-up {path['setup']}" if path.get("setup") else path["program"]
    if "reason" in path:
        return plain(f"not tried on {program}: {path['reason']}")
    means = sorted((figures["mean_N_per_mm"], name) for name, figures in path["explanations"].items())
    if len(means) < 2:
        return ""
    (low, softest), (high, stiffest) = means[0], means[-1]
    text = f"mean stiffness from {number(low)} ({softest}) to {number(high)} N/mm ({stiffest}) on {program}"
    return plain(f"{text}: {percent(path['mean_spread_percent'])} apart")


def plausible_text(names: Sequence[str]) -> str:
    """The plausible set in words."""
    words = ["none (nothing is missing)" if name == NONE else plain(name) for name in names]
    return ", ".join(words) or "no effect of the catalogue"


def data_text(diagnosis: Diagnosis) -> list[str]:
    """Number of readings, their files, the machine with its active effects."""
    machine = machine_text({"machine": diagnosis.machine.name, "effects": diagnosis.predictor.effects_that_act})
    return [counted(len(diagnosis.data), "reading"), ", ".join(diagnosis.names), f"machine {machine}"]


LABEL = 12  # columns of the left-hand words
FEW_REASONS = 3  # of proposed poses, shown on the terminal
MOST_CANDIDATES = 5  # in table and ladder; all are in diagnose.json
MOST_PAIRS = 2
LONGEST_NAME = 45


def text(diagnosis: Diagnosis) -> str:
    """The diagnosis in some 25 lines."""
    readings, files, machine = data_text(diagnosis)
    by_noise = [
        f"{name} ({percent(percent_of(under.noise.typical, 4))}): {under.verdict} ({plausible_text(under.plausible)})"
        for name, under in diagnosis.judgements.items()
    ]
    cannot = [
        f"{name} ({'no ' + ', '.join(lacks) if lacks else 'nothing in these data depends on it'})"
        for name, lacks in sorted(diagnosis.cannot_test.items())
    ]
    lines = [
        *_listed("data", [f"{readings} of {files}, {machine}"]),
        *_listed("verdict", [f"{diagnosis.verdict.upper()}. {verdict_text(diagnosis)}"]),
        *_listed("why", why(diagnosis)),
        *_listed("portrait", [portrait_text(diagnosis.portrait)] if diagnosis.portrait else []),
        *_listed("error", [_error(diagnosis)]),
        "",
        *_table(diagnosis),
        "",
        *_listed("plausible", [plausible_text(diagnosis.explanations)]),
        *_listed("beside it", [beside_text(diagnosis.beside)]),
        *_listed("noise", ["; ".join(by_noise)] if len(by_noise) > 1 else []),
        *_listed("beside the tip", [loop.text for loop in diagnosis.loops]),
        *_listed("cannot test", ["; ".join(cannot)]),
        *_listed("path", [path_text(diagnosis.path) or _UNTRIED] if diagnosis.verdict == "ambiguous" else []),
        *_hints("next", [*next_steps(diagnosis), *_next_readings(diagnosis)]),
        *_listed("assumptions", [f"{len(assumptions(diagnosis))}, listed in diagnose.json"]),
        *_listed("warning", diagnosis.predictor.data.warnings),
    ]
    return "\n".join(lines)


def _listed(label: str, sentences: Sequence[str]) -> list[str]:
    """One entry per sentence, with the label before the first."""
    texts = filter(None, sentences)
    return [line for place, text in enumerate(texts) for line in labelled("" if place else label, text, LABEL)]


def _hints(label: str, hints: Sequence[str]) -> list[str]:
    """Hints as `_listed` lists sentences; a command gets an unwrapped line of its own, so that it can be pasted."""
    lines: list[str] = []
    for sentence, command in map(parted, filter(None, hints)):
        lines += labelled("" if lines else label, sentence, LABEL)
        lines += [" " * (LABEL + 2) + plain(command)] if command else []
    return lines


def _error(diagnosis: Diagnosis) -> str:
    rows, floor = diagnosis.rows, json_number(diagnosis.noise.floor_percent) or 0.0
    steps = [f"{percent(rows.as_given.mean_abs_error_percent, 2)} as given"]
    best = None if diagnosis.verdict == "adequate" else rows.best
    for row, what in ((rows.refitted, "the strut law refitted"), *([(best, plain(best.label))] if best else [])):
        left_out = f"({percent(row.held_out_error_percent, 2)} at points left out)"
        steps.append(f"{percent(row.mean_abs_error_percent, 2)} {left_out} with {what}")
    scatter = scatter_text(floor, rows.refitted.mean_abs_error_percent or 0.0, diagnosis.noise.guess)
    return f"mean {', '.join(steps)}; {scatter}"


def leading_rows(diagnosis: Diagnosis) -> tuple[list[HypothesisRow], int]:
    """Rows to show: as given, strut law refitted, pairs and best candidates, all that stand; number of the others."""
    every = diagnosis.rows
    shown = [every.as_given, every.refitted, *every.pairs[:MOST_PAIRS], *every.candidates[:MOST_CANDIDATES]]
    shown += [row for row in every.candidates[MOST_CANDIDATES:] if row.standing]
    return shown, len(every.candidates) + len(every.pairs) + 2 - len(shown)


def _table(diagnosis: Diagnosis) -> list[str]:
    """The leading rows; an asterisk marks those left standing."""
    shown, more = leading_rows(diagnosis)
    cells = [
        (
            shortened(f"{'* ' if row.standing else '  '}{row.label}", LONGEST_NAME),
            probability_text(row.probability),
            number(row.mean_abs_error_percent, 2),
            number(row.held_out_error_percent, 2),
            number(row.held_out_gain_in_se, 1),
            row.words,
        )
        for row in shown
    ]
    head, *lines = ShownTable(("", ">probab.", ">error %", ">left out %", ">gain/SE", ""), cells).lines(least=0)
    for place, row in reversed([*enumerate(shown, 1)]):
        if below := "; ".join(filter(None, (", ".join(size_texts(row, intervals=False)), plain(row.remark)))):
            lines.insert(place, shortened(f"      {below}", WIDTH))
    return [head, *lines, *([f"  and {more} less likely, in diagnose.json"] if more > 0 else [])]


def _next_readings(diagnosis: Diagnosis) -> list[str]:
    if not diagnosis.next_measurements:
        return []
    reasons = list(dict.fromkeys(str(reading["why"]) for reading in diagnosis.next_measurements))
    more = [f"{len(reasons) - FEW_REASONS} more in the file"] if len(reasons) > FEW_REASONS else []
    listed = "; ".join([*reasons[:FEW_REASONS], *more])
    return [f"{counted(len(diagnosis.next_measurements), 'reading')} proposed in diagnose.json: {listed}"]
