"""Values of an effect's parameters, as an entry of a machine file or a user's hand gives them, in SI."""

from toolpath_stiff.machine.model import EffectEntry
from toolpath_stiff.stiffness.contract import Effect, Parameter, Values


def read_parameters(effect: Effect, entry: EffectEntry, where: str) -> Values:
    """SI values of an effect's parameters from a machine file's keys; choices as they are.

    Raises
    ------
    InputError
        A key is unknown or missing, a value is not a number or out of bounds; at its line of the machine file, or with
        `where` for an entry that stands in none.
    """
    by_key = {parameter.key: parameter for parameter in effect.parameters}
    for key in entry.parameters:
        if key not in by_key:
            known = f"one of {', '.join(by_key)}" if by_key else "no keys besides name and provenance"
            raise entry.error(f"effect {effect.name}: unknown key {key}", key, expected=known, where=where)
    values: dict[str, float | str] = {}
    for key, parameter in by_key.items():
        if key not in entry.parameters:
            mistake = f"effect {effect.name}: {key} is missing"
            raise entry.error(mistake, expected=parameter.expected, where=where)
        value = entry.parameters[key]
        if not _is_valid(parameter, value):
            mistake = f"effect {effect.name}: {key} = {value!r}"
            raise entry.error(mistake, key, expected=parameter.expected, where=where)
        values[parameter.name] = float(value) * parameter.si if parameter.kind == "real" else value
    return values


def _is_valid(parameter: Parameter, value: object) -> bool:
    if parameter.kind == "text":
        return isinstance(value, str)
    numbers = int if parameter.kind == "integer" else int | float
    low, high = parameter.bounds
    return isinstance(value, numbers) and not isinstance(value, bool) and low <= value <= high
