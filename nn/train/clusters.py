"""Bins of camera samples: what a renderer or `fathom cluster` makes of them.

Source: Vicini et al. 2019, "Denoising Deep Monte Carlo Renderings", appendix A, with the gap tested before the sample behind it. A bin
takes samples, front to back, until the sum of their relative distances, as sizes in pixels, passes (b + first)^exponent, b the bins begun.
"""

import numpy as np

from samples import WHERE, WIDTH

PHYSICAL = WHERE["noise"].start  # columns of a single camera sample


def labels(z, counts, scale, exponent, first):
    """The bin of each sample, (pixels, most), of depths (pixels, most), the first `counts` of a pixel ascending; scale: pixels per unit."""
    result = np.zeros(z.shape, np.int64)
    bins, total = np.ones(len(z)), np.zeros(len(z))
    for k in range(1, z.shape[1]):
        there = counts > k
        near = np.where(there, z[:, k - 1], 1)
        total += np.where(there, (z[:, k] - near) * scale / near, 0)
        split = there & (total > (bins + first) ** exponent)
        bins += split
        total[split] = 0
        result[:, k] = bins - 1
    return result


def gathered(values, counts, label):
    """Means per bin of (pixels, most, PHYSICAL) values: (bins, WIDTH) in the columns of samples.py, and the pixel of each."""
    most = values.shape[1]
    there = np.arange(most) < counts[:, None]
    pixel = np.nonzero(there)[0]
    key = pixel * most + label[there]
    start = np.flatnonzero(np.diff(key, prepend=-1))
    if not len(start):
        return np.zeros((0, WIDTH), np.float32), pixel
    listed = values[there].astype(np.float64)
    n = np.diff(np.append(start, len(key))).astype(np.float64)[:, None]
    result = np.zeros((len(start), WIDTH), np.float32)
    mean = np.add.reduceat(listed, start, 0) / n
    result[:, :PHYSICAL] = mean
    lights = slice(0, 6)
    off = listed[:, lights] - np.repeat(mean[:, lights], n[:, 0].astype(int), 0)
    variance = np.add.reduceat(off**2, start, 0) / np.maximum(n - 1, 1) / n
    result[:, WHERE["noise"]] = np.sqrt(variance.reshape(-1, 2, 3).mean(2))
    result[:, WHERE["count"]] = n
    return result, pixel[start]


def chosen(random, samples, wanted):
    """So many of the camera samples of each pixel, (..., spp, PHYSICAL), misses among them, in their order."""
    spp = samples.shape[-2]
    if wanted == spp:
        return samples
    keys = random.random(samples.shape[:-1], np.float32)
    kept = np.sort(np.argpartition(keys, wanted - 1, -1)[..., :wanted], -1)
    return np.take_along_axis(samples, kept[..., None], -2)
