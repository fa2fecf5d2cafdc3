"""Lengths of a chain that are hardly in metres."""

import numpy as np

from ._chain import SerialChain


# no industrial arm has a link of this length [m], none a reach beyond these [m]
LONGEST_LINK = 20.0
SHORTEST_REACH, LONGEST_REACH = 0.05, 50.0
# lengths of links in metres lie below
ORDINARY_LINK = 5.0


def length_doubts(chain: SerialChain) -> tuple[str, ...]:
    """What says that the lengths of a chain are not all in metres.

    A suspicion, not a proof: a reach above 50 m or below 5 cm, or offsets between
    neighbouring joints of which some exceed 20 m.

    Args:
        chain: the chain, with numbers that are known (not traced).

    Returns:
        One sentence for each suspicion; none where all looks well.
    """
    offsets = _offsets(chain)
    reach = float(np.sum(offsets[1:]))
    long = offsets[offsets > LONGEST_LINK]
    short = offsets[(offsets > 0) & (offsets < ORDINARY_LINK)]
    doubts = []
    if long.size and short.size:
        doubts.append(
            f"lengths must be in metres, but some offsets between joints, such as "
            f"{long.max():g}, look like millimetres beside others, such as "
            f"{short.min():g}: the units may be mixed"
        )
    elif long.size or reach > LONGEST_REACH:
        doubts.append(
            f"lengths must be in metres, but the offsets between joints add up to "
            f"{reach:g} m: they may be in millimetres"
        )
    elif 0 < reach < SHORTEST_REACH:
        doubts.append(
            f"lengths must be in metres, but the offsets between joints add up to "
            f"{reach:g} m only"
        )
    return tuple(doubts)


def _offsets(chain: SerialChain) -> np.ndarray:
    """Distances between neighbouring frames, from the base to the tool [m]."""
    frames = chain.joints.frames()
    before, after = np.asarray(frames.before), np.asarray(frames.after)
    behind = [np.asarray(chain.base), *after]
    ahead = [*before, np.asarray(chain.tool)]
    steps = [a @ b for a, b in zip(behind, ahead)]
    return np.array([np.linalg.norm(step[:3, 3]) for step in steps])
