"""Box-Behnken designs: three levels, no run at a corner, a full quadratic model.

The code is our own because libraries use all pairs of factors for any number of factors: 60 and 84 runs for six and
seven factors, where Box and Behnken have 48 and 56.
"""

from collections.abc import Sequence

import numpy as np

from repose.calibrate.designs.coding import two_level

# Factors that vary together, in orthogonal blocks; the others are at their centre (Box and Behnken 1960, Table 4).
BLOCKS: dict[int, Sequence[Sequence[tuple[int, ...]]]] = {
    3: [[(1, 2), (1, 3), (2, 3)]],
    4: [[(1, 2), (3, 4)], [(1, 4), (2, 3)], [(1, 3), (2, 4)]],
    5: [
        [(1, 2), (3, 4), (2, 5), (1, 3), (4, 5)],
        [(2, 3), (1, 4), (3, 5), (1, 5), (2, 4)],
    ],
    6: [[(1, 2, 4), (2, 3, 5), (3, 4, 6), (1, 4, 5), (2, 5, 6), (1, 3, 6)]],
    7: [[(4, 5, 6), (1, 6, 7), (2, 5, 7), (1, 2, 4), (3, 4, 7), (1, 3, 5), (2, 3, 6)]],
}


def box_behnken(factors: int, centres: int) -> np.ndarray:
    """Make a Box-Behnken design (n, factors) of -1, 0, 1 in standard order, one block after another.

    Box and Behnken, Some new three level designs for the study of quantitative variables, Technometrics 2 (1960)
    455-475. Blocks with equally many of the `centres` are orthogonal; simulations may ignore the blocks. `factors` is 3
    to 7; each block needs a centre run.
    """
    parts, rows = BLOCKS[factors], []
    for number, part in enumerate(parts, start=1):
        for together in part:
            signs = two_level(len(together))
            run = np.zeros((len(signs), factors))
            run[:, np.array(together) - 1] = signs
            rows.append(run)
        rows.append(
            np.zeros(
                (centres // len(parts) + (number <= centres % len(parts)), factors)
            )
        )
    return np.vstack(rows)
