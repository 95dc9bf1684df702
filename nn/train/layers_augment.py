"""Variations of a crop of camera samples: how many of them, and in which form; exposure, flips, colours, patterns, lit backdrops, missing features."""

import numpy as np

import augment
from augment import FAINT, PATTERNED, SHARES, STOPS, drawn_pattern, half_plane
from clusters import PHYSICAL, chosen, gathered, labels
from layers_model import assembled
from planes import LIGHTS
from samples import FEATURES, UNKNOWN_ALBEDO, WHERE, WIDTH, divided, inputs, light_of, pixel_deviations

# Raw camera samples; bins of them; all of a pixel in one, which is what a network on pixels sees.
FORMS = {"samples": 0.5, "bins": 0.35, "pixels": 0.15}
COUNTS = {2: 0.1, 4: 0.2, 8: 0.35, 16: 0.1, 32: 0.15, 64: 0.1}  # camera samples per pixel that are taken
MOST_RAW = 16  # and of raw ones, which cost most and gain least where there are many
EXPONENTS, FIRSTS = (1.0, 1.5, 2.0, 3.0), (0, 1)  # of the clustering

# How often a feature is taken away. Bins seldom know where on the lens their samples were.
MISSING = {("albedo",): 0.1, ("normal",): 0.1, ("coc",): 0.25, ("lens",): 0.25, ("components",): 0.15, ("noise",): 0.2}
BARE = 0.05  # share of crops with light and depth alone

# Lamps and windows are even, bright and seldom seen, and matte walls around them spread their want of specular light over them. So some crops have a
# panel of even light, and in some of those with something empty that is filled with light; in stops from the frame's mean. A backdrop fills
# all or, in half of the cases, a part of what is empty, and is this far behind what is farthest.
PANELS, LIT, LIGHT_STOPS, BEHIND = 0.25, 0.5, (-2.0, 4.5), (1.02, 4.0)
PANEL_SIDES = (0.1, 0.8)  # half of a panel's sides over half of the crop's


def drawn_count(random, form, spp):
    counts = [n for n in COUNTS if n <= spp and (form != "samples" or n <= MOST_RAW)] or [spp]
    shares = np.array([COUNTS.get(n, 1) for n in counts])
    return int(random.choice(counts, p=shares / shares.sum()))


def formed(random, form, samples, scale):
    """The columns of samples.py, weights and pixels of a crop's (pixels, spp, PHYSICAL) samples."""
    counts = (samples[:, :, WHERE["depth"].start] > 0).sum(1)
    if form == "samples":
        there = np.arange(samples.shape[1]) < counts[:, None]
        values = np.zeros((int(counts.sum()), WIDTH), np.float32)
        values[:, :PHYSICAL], values[:, WHERE["count"]] = samples[there], 1
        pixel = np.nonzero(there)[0]
        values[:, WHERE["noise"]] = pixel_deviations(values[:, :6], values[:, WHERE["count"]][:, 0], pixel)
    else:
        if form == "bins":
            label = labels(samples[:, :, WHERE["depth"].start], counts, scale, random.choice(EXPONENTS), random.choice(FIRSTS))
        else:
            label = np.zeros(samples.shape[:2], np.int64)
        values, pixel = gathered(samples, counts, label)
    return values, values[:, WHERE["count"]][:, 0] / samples.shape[1], pixel


def without(values, gone):
    """A list that lacks some of its features, in place."""
    if "components" in gone:
        values[:, WHERE["specular"]] = light_of(values)
        values[:, WHERE["diffuse"]] = 0
        noise = values[:, WHERE["noise"]]
        noise[:, 1] = np.sqrt((noise**2).sum(1))  # as if the components were independent
        noise[:, 0] = 0
    for name, unknown in (("albedo", UNKNOWN_ALBEDO), ("normal", 0), ("coc", 0), ("lens", 0), ("noise", 0)):
        if name in gone:
            values[:, WHERE[name]] = unknown


def missing(random, given):
    gone = {name for names, share in MISSING.items() if random.random() < share for name in names}
    if random.random() < BARE:
        gone.update(*MISSING)
    return gone | (set(FEATURES) - given)


def turned_lens(lens, flips, transposed):
    """Places on the lens, (..., 2) in [0, 1), V upwards, with the picture upside down, left to right, then across the diagonal."""
    u, v = lens[..., 0], lens[..., 1]
    u, v = (1 - u if flips[1] else u), (1 - v if flips[0] else v)
    return np.stack([1 - v, 1 - u] if transposed else [u, v], -1)


def turned(random, samples, targets):
    """Both, (height, width, ...), flipped or transposed, with normals, places on the lens and colours to fit."""
    flips, transposed = random.random(2) < 0.5, random.random() < 0.5
    axes, signs = augment.turned_normals(random, flips, transposed)
    colours = random.permutation(3)
    result = []
    for x in (samples, targets):
        x = x[:: -1 if flips[0] else 1, :: -1 if flips[1] else 1]
        result.append((x.swapaxes(0, 1) if transposed else x).copy())
    samples, targets = result
    for name in ("diffuse", "specular", "albedo"):
        samples[..., WHERE[name]] = samples[..., WHERE[name]][..., colours]
    for k in range(len(LIGHTS)):
        targets[..., 3 * k : 3 * k + 3] = targets[..., 3 * k + colours]
    samples[..., WHERE["normal"]] = samples[..., WHERE["normal"]][..., axes] * signs
    samples[..., WHERE["lens"]] = turned_lens(samples[..., WHERE["lens"]], flips, transposed)
    return samples, targets


def drawn_light(random, exposure):
    return 2.0 ** random.uniform(*LIGHT_STOPS) * random.uniform(0.5, 1, 3) / exposure


def with_panel(random, samples, targets, exposure):
    """The crop with a rectangle that gives light and reflects none, in place."""
    height, width = targets.shape[:2]
    angle, place = random.uniform(0, np.pi), np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j] - random.uniform(-0.8, 0.8, (2, 1, 1))
    along, across = (place[0] * np.sin(a) + place[1] * np.cos(a) for a in (angle, angle + np.pi / 2))
    inside = (np.abs(along) < random.uniform(*PANEL_SIDES)) & (np.abs(across) < random.uniform(*PANEL_SIDES))
    light = drawn_light(random, exposure)
    hit = (samples[..., WHERE["depth"].start] > 0) & inside[..., None]
    for name, value in (("diffuse", 0), ("specular", light), ("albedo", 0)):
        samples[..., WHERE[name]][hit] = value
    for k, name in enumerate(LIGHTS):
        targets[inside, 3 * k : 3 * k + 3] = targets[inside, -2:-1] * (light * (name != "diffuse"))


def with_backdrop(random, samples, targets, exposure):
    """The crop with an even light where camera samples hit nothing, in place. Its surface has no albedo and faces nowhere."""
    height, width = targets.shape[:2]
    there = samples[..., WHERE["depth"].start] > 0
    empty = 1 - targets[..., -2]
    if targets[..., -1].min() < 1 or there.all() or not there.any() or not empty.max() > 0.01:  # or what is behind is seen, and not known
        return
    lit = half_plane(random, height, width) if random.random() < 0.5 else np.ones((height, width), bool)
    light = drawn_light(random, exposure)
    farthest = samples[there][np.argmax(samples[there][:, WHERE["depth"].start])]
    added = np.zeros(samples.shape[-1], np.float32)
    added[WHERE["specular"]] = light
    added[WHERE["depth"]] = farthest[WHERE["depth"]] * random.uniform(*BEHIND)
    added[WHERE["coc"]] = farthest[WHERE["coc"]]
    filled = ~there & lit[..., None]
    samples[filled] = added
    samples[..., WHERE["lens"]][filled] = random.random((int(filled.sum()), 2))
    for k, name in enumerate(LIGHTS):
        if name != "diffuse":
            targets[..., 3 * k : 3 * k + 3] += (lit * empty)[..., None] * light
    targets[..., -2][lit] = 1


def with_one_light(random, samples, targets):
    """The crop with its diffuse or its specular light alone, or with both; targets (height, width, 8): of that light, alpha, counts, and the
    other light; and its name."""
    means = dict(zip(LIGHTS, targets[..., : 3 * len(LIGHTS)].reshape(-1, len(LIGHTS), 3).mean((0, 2))))
    names = [name for name in LIGHTS if name == "rgb" or means[name] > FAINT * means["rgb"]]
    shares = np.array([SHARES[name] for name in names])
    light = names[random.choice(len(names), p=shares / shares.sum())]
    for name in LIGHTS[1:]:
        if light not in ("rgb", name):
            samples[..., WHERE[name]] = 0
    first = 3 * LIGHTS.index(light)
    chosen, whole = targets[..., first : first + 3], targets[..., :3]
    return samples, np.concatenate([chosen, targets[..., -2:], np.maximum(whole - chosen, 0)], -1), light


LIT_TARGETS = [0, 1, 2, 5, 6, 7]


def varied(random, frame, samples, targets):
    """What layers_model.assembled takes of a variation of the crop, and its targets (height, width, 8), light times the exposure."""
    form = random.choice(list(FORMS), p=list(FORMS.values()))
    samples = chosen(random, samples, drawn_count(random, form, frame.spp)).astype(np.float32)
    samples, targets = turned(random, samples, targets)
    if random.random() < PANELS:
        with_panel(random, samples, targets, frame.exposure)
    if random.random() < LIT:
        with_backdrop(random, samples, targets, frame.exposure)
    samples, targets, light = with_one_light(random, samples, targets)
    if random.random() < PATTERNED:
        pattern = drawn_pattern(random, *targets.shape[:2])[0][:, :, None]
        samples[..., :6] *= pattern[..., None]
        targets[..., LIT_TARGETS] *= pattern
        if random.random() < augment.SHOWN["albedo"]:
            albedo = samples[..., WHERE["albedo"]]
            np.minimum(albedo * pattern[..., None], 1, out=albedo)
    values, weight, pixel = formed(random, form, samples.reshape(-1, *samples.shape[2:]), frame.scale)
    gone = missing(random, frame.given)
    without(values, gone)
    apart = light == "diffuse" and "components" not in gone
    values, divisor = divided(values) if apart else (values, np.ones((len(values), 3), np.float32))
    scale = frame.exposure * 2.0 ** random.uniform(-STOPS, STOPS)
    targets[..., LIT_TARGETS] = scale * np.maximum(targets[..., LIT_TARGETS], 0)
    z = values[:, WHERE["depth"]][:, 0]
    return (inputs(values, weight, scale, frame.depth), weight, scale * light_of(values), z / frame.depth, divisor, pixel), targets


class Batches(augment.Batches):
    def batch(self, step, count):
        """Samples of `count` crops, and their targets (count, 8, height, width)."""
        random = np.random.default_rng([self.seed, step])
        parts = [varied(random, *crop) for crop in self.crops(random, count)]
        targets = np.stack([x for _, x in parts]).transpose(0, 3, 1, 2)
        return assembled([x for x, _ in parts], (self.size, self.size)), np.ascontiguousarray(targets)
