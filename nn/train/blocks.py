"""What a block of the network's input planes looks like, in a few numbers: nn/components.cpp computes the same.

Blocks have sides that are multiples of 4. A cell is 4x4 pixels; *spread* is the standard deviation of cells' means, and
the log light is the mean of planes 0 to 2.
"""

import numpy as np

CELL = 4
NAMES = (
    "constant",
    "noise",  # the mean of plane 11
    "halves",  # and of 15
    "light",  # of the log light
    "spread of light",
    "grain",  # the mean distance of the log light from its cell's mean
    "spread of features",  # the mean of those of planes 3 to 8
    "noise of features",  # the mean of planes 12 to 14
    "rest",  # and of 16 to 18
    "spread of noise",  # that of plane 11
    "kind",  # plane 23
    "part",  # 1 where that is not 0: the block has one of two lights
)


def cells(planes):
    count, height, width = planes.shape
    return planes.reshape(count, height // CELL, CELL, width // CELL, CELL).mean((2, 4), dtype=np.float64)


def statistics(planes):
    """The numbers of NAMES for planes (24, height, width), float64."""
    light = planes[:3].mean(0, keepdims=True, dtype=np.float64)
    of_light = cells(light)
    grain = np.abs(light - of_light.repeat(CELL, 1).repeat(CELL, 2)).mean()
    mean = planes.mean((1, 2), dtype=np.float64)
    kind = float(planes[23, 0, 0])  # the same everywhere
    return np.array([
        1,
        mean[11],
        mean[15],
        mean[:3].mean(),
        of_light.std(),
        grain,
        cells(planes[3:9]).std((1, 2)).mean(),
        mean[12:15].mean(),
        mean[16:19].mean(),
        cells(planes[11:12]).std(),
        kind,
        float(kind != 0),
    ])
