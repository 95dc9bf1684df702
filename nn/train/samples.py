"""The 20 inputs per sample of the layered network from the channels of a deep frame: camera samples or bins of them.

In two steps, as in `planes.py`: `measure` reduces the channels to a list of what a sample has, in scene units and not premultiplied;
`inputs` makes the network's input of it. A sample of alpha 0, or whose colour or depth is not finite, has no say and is left out.

The columns of a list, and how many each takes, are in COLUMNS:
  diffuse, specular          light; without components all of it is specular
  albedo, normal             the features
  depth, coc, lens           Z, circle of confusion, place on the lens
  noise                      root of the mean over the channels of the variance of diffuse and of specular; 0 where unknown. A bin's is that of
                             its own means, a camera sample's that of its pixel's, from all of the pixel's samples
  count                      camera samples in the bin
"""

from collections import namedtuple

import numpy as np

from planes import DARK, LARGEST_DEVIATION, LIGHTS, exposure, layout

COLUMNS = {"diffuse": 3, "specular": 3, "albedo": 3, "normal": 3, "depth": 1, "coc": 1, "lens": 2, "noise": 2, "count": 1}
WHERE, WIDTH = layout(COLUMNS)
FEATURES = ("albedo", "normal", "coc", "lens")
UNKNOWN_ALBEDO = 0.5
LEAST_ALBEDO = 0.1
COC_UNIT = 4  # pixels
COUNT_UNIT = 8  # doublings
LARGEST = 1e15  # beyond, a value counts as not finite

# values: (S, WIDTH) float32; weight: (S,), the share of the pixel; pixel: (S,), ascending; shape: (height, width); given: those of FEATURES that
# the frame has; divisor: (S, 3), what the light was divided by.
Deep = namedtuple("Deep", "values weight pixel shape given divisor", defaults=(1,))


def effective(alpha, counts):
    """What a sample weighs in its pixel, behind the samples in front of it; counts: of samples per pixel."""
    start = np.cumsum(counts) - counts
    weight, passed = np.zeros(len(alpha)), np.ones(len(counts))
    for k in range(int(counts.max(initial=0))):
        at = start[counts > k] + k
        weight[at] = alpha[at] * passed[counts > k]
        passed[counts > k] *= 1 - alpha[at]
    return weight


def columns(channels, prefix, names="RGB"):
    """(S, 3) of `prefix`.R and so on; None where one is missing."""
    found = [channels.get(f"{prefix}.{name}" if prefix else name) for name in names]
    return None if any(x is None for x in found) else np.stack(found, 1).astype(np.float64)


def deviation(channels, prefix):
    """Root of the mean variance, 0 where it is unknown; None without the channels."""
    variance = columns(channels, prefix)
    if variance is None:
        return None
    known = np.isfinite(variance).all(1)
    return np.sqrt(np.where(known[:, None], variance, 0).clip(min=0).mean(1))


def pixel_deviations(light, weight, pixel):
    """The deviation of each pixel's means over its camera samples, for each of its samples: (S, 2), 0 where there is one sample alone; of
    light (S, 6), diffuse and specular, and weights."""
    start = np.flatnonzero(np.diff(pixel, prepend=-1))
    if not len(start):
        return np.zeros((0, 2))
    of = np.repeat(np.arange(len(start)), np.diff(np.append(start, len(pixel))))
    share = weight.astype(np.float64) / np.add.reduceat(weight.astype(np.float64), start)[of]
    off = light - np.add.reduceat(share[:, None] * light, start, 0)[of]
    squares = np.add.reduceat((share[:, None] * off) ** 2, start, 0).reshape(-1, 2, 3).mean(2)
    independent = 1 - np.add.reduceat(share**2, start)  # of n equal ones 1 - 1 / n
    return np.sqrt(squares / np.where(independent > 1e-6, independent, np.inf)[:, None])[of]


def measure(counts, channels, spp=None):
    """The list of a frame: counts (height, width), of samples, and {name: (S,)}, pixel after pixel, front to back."""
    alpha = channels["A"].astype(np.float64)
    weight = effective(alpha, counts.ravel())
    values = np.zeros((len(alpha), WIDTH))
    given = set()
    over = np.where(alpha > 0, alpha, 1)[:, None]
    light = [columns(channels, name) for name in LIGHTS[1:]]
    whole = columns(channels, "")
    if all(x is not None for x in light):
        values[:, WHERE["diffuse"]], values[:, WHERE["specular"]] = light[0] / over, light[1] / over
    else:
        values[:, WHERE["specular"]] = whole / over
    values[:, WHERE["albedo"]] = UNKNOWN_ALBEDO
    for name, found in (("albedo", columns(channels, "albedo")), ("normal", columns(channels, "N", "XYZ"))):
        if found is not None:
            values[:, WHERE[name]] = found / over
            given.add(name)
    values[:, WHERE["depth"]] = channels["Z"][:, None]
    for name, found in (("coc", [channels.get("coc")]), ("lens", [channels.get("lens.U"), channels.get("lens.V")])):
        if all(x is not None for x in found):
            values[:, WHERE[name]] = np.stack(found, 1)
            given.add(name)
    noise = [deviation(channels, f"variance.{name}") for name in LIGHTS[1:]]
    noise[1] = deviation(channels, "variance") if noise[1] is None else noise[1]
    for k, x in enumerate(noise):
        if x is not None:
            values[:, WHERE["noise"].start + k] = x
    values[:, WHERE["count"]] = (channels["samples"] if "samples" in channels else weight * spp if spp else np.ones(len(alpha)))[:, None]
    needed = np.concatenate([values[:, :6], values[:, WHERE["depth"]]], 1)
    used = (weight > 0) & (np.abs(np.where(np.isfinite(needed), needed, np.inf)) <= LARGEST).all(1)
    pixel = np.repeat(np.arange(counts.size), counts.ravel())[used]
    if spp and "samples" not in channels and all(x is None for x in noise):  # camera samples
        values[used, WHERE["noise"]] = pixel_deviations(values[used, :6], weight[used], pixel)
    kept = np.where(np.isfinite(values[used]), values[used], 0).astype(np.float32)
    return Deep(kept, weight[used].astype(np.float32), pixel, counts.shape, frozenset(given))


def light_of(values):
    """All light, (S, 3)."""
    return values[:, WHERE["diffuse"]] + values[:, WHERE["specular"]]


def divided(values):
    """A list whose light is diffuse, divided by the albedo; and the divisor (S, 3)."""
    divisor = np.clip(values[:, WHERE["albedo"]], 0, 1) + np.float32(LEAST_ALBEDO)
    values = values.copy()
    values[:, WHERE["diffuse"]] /= divisor
    values[:, WHERE["noise"].start] /= divisor.mean(1)
    return values, divisor


def alone(deep, light):
    """A list with one of LIGHTS[1:] as all of its light, the diffuse one divided."""
    values = deep.values.copy()
    for k, name in enumerate(LIGHTS[1:]):
        if name != light:
            values[:, WHERE[name]] = 0
            values[:, WHERE["noise"].start + k] = 0
    if light == "diffuse":
        values, divisor = divided(values)
        return deep._replace(values=values, divisor=divisor)
    return deep._replace(values=values)


def lights_apart(deep):
    """What the network denoises one after the other, of what light a list has: first the diffuse, then the specular one."""
    found = [name for name in LIGHTS[1:] if deep.values[:, WHERE[name]].any()]
    return [alone(deep, name) for name in found or LIGHTS[2:]]


def flattened(deep, columns):
    """The weighted sums of (S, n) per pixel, (n, height, width)."""
    size = deep.shape[0] * deep.shape[1]
    sums = [np.bincount(deep.pixel, deep.weight * x, size) for x in columns.T.astype(np.float64)]
    return np.reshape(sums, (-1, *deep.shape)).astype(np.float32)


def exposure_of(deep):
    return exposure(flattened(deep, light_of(deep.values)))


def mean_depth(deep):
    """By weight, over the frame; 1 for an empty one."""
    total = deep.weight.sum(dtype=np.float64)
    return float((deep.weight * deep.values[:, WHERE["depth"]][:, 0].astype(np.float64)).sum() / total) if total > 0 else 1.0


def inputs(values, weight, scale, depth):
    """The network's (S, 20) of a list's values and weights; scale: the exposure; depth: the frame's mean."""
    z, coc, lens = values[:, WHERE["depth"]], values[:, WHERE["coc"]], values[:, WHERE["lens"]]
    lights = [np.maximum(scale * values[:, WHERE[name]], 0) for name in LIGHTS[1:]]
    relative = [
        np.log1p(np.minimum(scale * values[:, WHERE["noise"]][:, k] / (x.mean(1) + DARK), LARGEST_DEVIATION)) for k, x in enumerate(lights)
    ]
    result = [
        *(np.log1p(x) for x in lights),
        np.clip(values[:, WHERE["albedo"]], 0, 1),
        np.clip(values[:, WHERE["normal"]], -1, 1),
        z / (z + depth),
        coc / (np.abs(coc) + COC_UNIT),
        np.clip(lens, -1, 1),
        weight[:, None],
        *(x[:, None] for x in relative),
        np.log2(1 + values[:, WHERE["count"]]) / COUNT_UNIT,
    ]
    return np.concatenate(result, 1).astype(np.float32)


def padded(shape):
    """(height, width), filled up to multiples of 4."""
    return tuple(side + -side % 4 for side in shape)


def listed(deep, scale, depth):
    """Inputs, weights, exposed light, depths, divisors and pixels of the padded frame: what layers_model.assembled takes."""
    rows, columns = np.divmod(deep.pixel, deep.shape[1])
    z = deep.values[:, WHERE["depth"]][:, 0]
    pixel = rows * padded(deep.shape)[1] + columns
    divisor = np.broadcast_to(deep.divisor, (len(z), 3))
    return inputs(deep.values, deep.weight, scale, depth), deep.weight, scale * light_of(deep.values), z, divisor, pixel
