"""Sets of responses whose information is compared."""

from collections.abc import Sequence

from repose.core.responses import Response, response
from repose.measure import further_responses

WHOLE_PILE, EVERYTHING = "whole pile", "pile and drum"


def base_label(responses: Sequence[Response]) -> str:
    """Name of the set of all targets, as in ``AoR and Height``.

    Parameters
    ----------
    responses : sequence of Response

    Returns
    -------
    str
    """
    symbols = [one.symbol for one in responses]
    return " and ".join(filter(None, [", ".join(symbols[:-1]), symbols[-1]]))


def sets_of(names: Sequence[str], responses: Sequence[Response]) -> dict[str, tuple[str, ...]]:
    """Sets of responses to compare, by label.

    Parameters
    ----------
    names : sequence of str
        All responses that are modelled.
    responses : sequence of Response
        Those of the targets.

    Returns
    -------
    dict
        The first target alone (where there are several), the targets, and the targets with each further response. Then
        the targets with all responses of the pile, and with all responses (where some are not of the pile).
    """
    base = tuple(one.name for one in responses)
    extra = [name for name in names if name not in base]
    pile = [name for name in extra if source_of(name) == "pile"]
    found = {f"{responses[0].symbol} alone": base[:1]} if len(base) > 1 else {}
    found |= {base_label(responses): base}
    found |= {name: (*base, name) for name in extra}
    found[WHOLE_PILE] = (*base, *pile)
    if len(pile) < len(extra):
        found[EVERYTHING] = (*base, *extra)
    return found


def source_of(name: str) -> str:
    """Where a response comes from, as the tables say it.

    Parameters
    ----------
    name : str
        Of the response.

    Returns
    -------
    str
        "pile", or the name of another bench test.
    """
    bench = response(name).apparatus
    return "pile" if bench == further_responses.BENCH else bench
