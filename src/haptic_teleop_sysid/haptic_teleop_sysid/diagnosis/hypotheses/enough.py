"""Does an effect gain enough, on recordings it was fitted to and on others, to be believed to be there?"""

from __future__ import annotations

import numpy as np

from ..policy import CLEAR_GAIN, LEAST_AGAINST, LEAST_GAIN, LEAST_HELD_OUT


def gains_enough(gain: float, elsewhere: float, alone: bool = True) -> bool:
    """Whether an effect that gains ``gain`` nats on the estimation recordings and ``elsewhere`` on the
    validation ones is there: what either lacks the other may make up for, in the bounds of the policy.

    ``alone``: no other effect was found before. The form of that may not be quite right, which other
    recordings show as well: then the estimation recordings alone must gain LEAST_GAIN.
    """
    half = 0.5 * LEAST_GAIN
    asked = np.interp(
        gain, (half, LEAST_GAIN, CLEAR_GAIN), (LEAST_HELD_OUT + half, LEAST_HELD_OUT, -LEAST_AGAINST)
    )
    return gain >= (half if alone else LEAST_GAIN) and elsewhere >= float(asked)
