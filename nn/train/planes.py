"""The 24 input planes of the network from the channels of a frame.

In two steps, so that training can keep the first and repeat the second with other exposures and missing features:
`measure` reduces a frame's channels to a stack of physical layers, float32 (layers, height, width) in scene units, and
`planes` makes the network's input of it. Light is linear; flat channels are premultiplied by the pixel's alpha.

The layers of a stack, and how many channels each has, are in LAYERS:
  rgb, diffuse, specular     light
  alpha                      1 where there is none
  albedo, normal             the features
  depth                      Z divided by the mean of Z where something was hit; 0 where nothing was
  *.noise                    of light and features: the root of the mean over the channels of the variance; of depth:
                             the root of the variance over Z
  *.root                     of light: the mean over R, G, B of the root of the variance
  *.halves                   of light: the mean over R, G, B of |half0 - half1|
"""

import numpy as np

LIGHTS = ("rgb", "diffuse", "specular")
FEATURES = ("albedo", "normal", "depth")
KIND = {"diffuse": 1.0, "specular": -1.0, "rgb": 0.0}
KEY = 0.2  # the geometric mean of exposed blocks
BLOCK = 8
TINY_BLOCK = 1e-3
LEAST_ALBEDO = 0.02
DARK = 0.01  # keeps relative deviations of dark pixels small
LARGEST_DEVIATION = 8
HALVES_PER_DEVIATION = 1.6  # |half0 - half1| of a deviation of 1 of the mean

LAYERS = {name: 3 for name in (*LIGHTS, "albedo", "normal")}
LAYERS.update({name: 1 for name in ("depth", "alpha", *(f"{x}.noise" for x in (*LIGHTS, *FEATURES)))})
LAYERS.update({f"{x}.{what}": 1 for x in LIGHTS for what in ("root", "halves")})


def layout(layers):
    """{name: slice into a stack} and the count of channels."""
    where, begin = {}, 0
    for name, channels in layers.items():
        where[name] = slice(begin, begin + channels)
        begin += channels
    return where, begin


WHERE, STACK_CHANNELS = layout(LAYERS)


def exposure(rgb):
    """The factor that brings the blocks of a frame, (3, height, width), to the key on the geometric mean."""
    luminance = rgb.mean(0, dtype=np.float64)
    rows, columns = (np.arange(0, side, BLOCK) for side in luminance.shape)
    sums = np.add.reduceat(np.add.reduceat(luminance, rows, 0), columns, 1)
    counts = np.outer(np.diff(np.append(rows, luminance.shape[0])), np.diff(np.append(columns, luminance.shape[1])))
    means = (sums / counts)[sums > 0]
    if not means.size:
        return 1.0
    means = np.maximum(means, TINY_BLOCK * means.mean())
    return float(KEY / np.exp(np.log(means).mean()))


def triple(channels, prefix, names="RGB"):
    """(3, height, width) of `prefix`.R and so on, what is not finite as 0; None where one is missing."""
    found = [channels.get(f"{prefix}.{name}" if prefix else name) for name in names]
    if any(x is None for x in found):
        return None
    return finite(np.stack(found))


def finite(x):
    return np.where(np.isfinite(x), x, 0).astype(np.float32)


def light(channels, prefix):
    """The whole light under a prefix ("", "half0", "half1"): R, G, B, or the sum of its components; None without."""
    whole = triple(channels, prefix)
    if whole is not None:
        return whole
    parts = [triple(channels, f"{prefix}.{x}" if prefix else x) for x in LIGHTS[1:]]
    return None if any(x is None for x in parts) else parts[0] + parts[1]


def component(channels, name, prefix=""):
    if name == "rgb":
        return light(channels, prefix)
    return triple(channels, f"{prefix}.{name}" if prefix else name)


def measure(channels):
    """The stack of a frame, and the set of what it has: names of layers, less those that are estimated or missing."""
    height, width = channels["R"].shape
    stack = np.zeros((STACK_CHANNELS, height, width), np.float32)
    given = set()

    def put(name, value):
        if value is not None:
            stack[WHERE[name]] = value
            given.add(name)

    whole_variance = triple(channels, "variance")
    for name in LIGHTS:
        put(name, component(channels, name))
        own = None if name == "rgb" else triple(channels, f"variance.{name}")
        variance = whole_variance if own is None else own
        if variance is not None and name in given:
            variance = np.maximum(variance, 0)
            put(f"{name}.noise", np.sqrt(variance.mean(0)))
            put(f"{name}.root", np.sqrt(variance).mean(0))
        halves = [component(channels, name, half) for half in ("half0", "half1")]
        if name in given and all(x is not None for x in halves):
            put(f"{name}.halves", np.abs(halves[0] - halves[1]).mean(0))

    put("alpha", finite(channels["A"]) if "A" in channels else np.ones((height, width)))
    for name, prefix, axes in (("albedo", "albedo", "RGB"), ("normal", "N", "XYZ")):
        put(name, triple(channels, prefix, axes))
        variance = triple(channels, f"variance.{prefix}", axes)
        if variance is not None and name in given:
            put(f"{name}.noise", np.sqrt(np.maximum(variance, 0).mean(0)))
    if "Z" in channels:
        z = np.maximum(finite(channels["Z"]), 0)
        hit = z > 0
        put("depth", z / (z[hit].mean(dtype=np.float64) if hit.any() else 1))
        if "variance.Z" in channels:
            deviation = np.sqrt(np.maximum(finite(channels["variance.Z"]), 0))
            put("depth.noise", np.divide(deviation, z, out=np.zeros_like(z), where=hit))
    return stack, given


def planes(stack, given, name, scale):
    """The input of the network for one component of a frame, the component's colour, and what that was divided by.

    stack, given: as `measure` returns them; what is not in `given` counts as missing, whatever the stack has there.
    name: one of LIGHTS. scale: the exposure. Returns float32 (24, height, width) and twice (3, height, width): the colour
    times the exposure, at least 0, over the divisor; and that, the albedo and a little for diffuse light, 1 else.
    """

    def layer(which):
        return stack[WHERE[which]] if which in given else np.zeros_like(stack[WHERE[which]])

    albedo = np.clip(layer("albedo"), 0, 1)
    divided = name == "diffuse" and "albedo" in given
    divisor = albedo + np.float32(LEAST_ALBEDO) if divided else np.ones_like(albedo)
    colour = np.maximum(scale * layer(name), 0) / divisor
    mean = (colour.mean(0, keepdims=True) + DARK) * divisor.mean(0, keepdims=True)

    def relative(x):
        return np.log1p(np.minimum(x * scale / mean, LARGEST_DEVIATION))

    halves = layer(f"{name}.halves")
    if f"{name}.halves" not in given:
        halves = HALVES_PER_DEVIATION * layer(f"{name}.root")
    rest = np.zeros_like(colour) if name == "rgb" else scale * np.maximum(layer("rgb") - layer(name), 0)
    depth = layer("depth")
    flags = [feature in given for feature in FEATURES] + [f"{name}.noise" in given]
    result = [
        np.log1p(colour),
        albedo,
        np.clip(layer("normal"), -1, 1),
        depth / (depth + 1),
        layer("alpha") if "alpha" in given else np.ones_like(depth),
        relative(layer(f"{name}.noise")),
        np.minimum(layer("albedo.noise"), 1),
        np.minimum(layer("normal.noise"), 1),
        np.minimum(layer("depth.noise"), 1),
        relative(halves),
        np.log1p(rest),
        *(np.full_like(depth, flag) for flag in flags),
        np.full_like(depth, KIND[name]),
    ]
    return tuple(x.astype(np.float32, copy=False) for x in (np.concatenate(result), colour, divisor))
