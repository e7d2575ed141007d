"""Box-Behnken designs: three levels, no run at a corner, a full quadratic model.

The designs are written out here because libraries use all pairs of factors for any
number of factors. For six and seven factors this takes 60 and 84 runs, whereas the
designs of Box and Behnken have 48 and 56.
"""

from collections.abc import Sequence

import numpy as np

from repose.calibrate.designs.coding import make_full_factorial

# The orthogonal blocks of each number of factors. An entry of a block lists the factors
# that vary together while the others are at their centre (Box and Behnken 1960, Table
# 4).
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
    """Make a Box-Behnken design in standard order, one block after another.

    The design is that of Box and Behnken, Some new three level designs for the study of
    quantitative variables, Technometrics 2 (1960) 455-475. Its blocks are orthogonal if
    they all have the same number of centre runs. Simulations may ignore the blocks.

    Parameters
    ----------
    factors : int
        Number of factors, from 3 to 7.
    centres : int
        Number of centre runs, at least one for each block.

    Returns
    -------
    array (n, factors)
        The runs in coded units: -1, 0 or 1 for each factor.
    """
    # `BLOCKS` lists the groups of factors that vary together. Factors are numbered
    # from 1 there, as in the printed table.
    blocks = BLOCKS[factors]
    runs = []
    for block_number, block in enumerate(blocks, start=1):
        # Add all corners of a group of factors, with the other factors at the centre.
        for factor_numbers in block:
            corners = make_full_factorial(len(factor_numbers))
            group = np.zeros((len(corners), factors))
            columns = np.array(factor_numbers) - 1
            group[:, columns] = corners
            runs.append(group)
        # Divide the centre runs equally. If some remain, the first blocks get one more.
        n_centres = centres // len(blocks)
        if block_number <= centres % len(blocks):
            n_centres += 1
        runs.append(np.zeros((n_centres, factors)))
    return np.vstack(runs)
