"""Random emitters. Their scale is arbitrary: a view's exposure sets the level of all light."""
import mitsuba as mi
import numpy as np

import meshes
from camera import unit


def tint(rng):
    """The colour of a lamp: mostly warm to cool white, at times saturated."""
    if rng.random() < 0.2:
        return rng.uniform(0.05, 1, 3)
    warm = rng.uniform(-0.5, 0.5)
    return np.array([1 + 0.5 * warm, 1, 1 - 0.7 * warm]) * rng.uniform(0.9, 1.1, 3)


def facing(direction):
    """A rotation that takes the z axis to `direction`."""
    z = unit(direction)
    x = unit(np.cross(z, [0.3, 0.5, 0.8] if abs(z[2]) > 0.9 else [0, 0, 1]))
    return np.stack([x, np.cross(z, x), z], axis=1)


def lamp(rng, position, target, size, power):
    """An area light of `size` at a position; flat ones shine towards the target."""
    kind = rng.choice(3, p=[0.6, 0.2, 0.2])
    mesh = (meshes.plane, meshes.disk, meshes.sphere)[kind]()
    scale = size * np.array([1, rng.uniform(0.15, 1) if kind == 0 else 1, 1])
    mesh = mesh.moved(scale, facing(np.subtract(target, position)), position)
    radiance = power * tint(rng) / (size * scale[1])
    emitter = mi.load_dict({'type': 'area', 'radiance': {'type': 'rgb', 'value': radiance.tolist()}})
    dark = mi.load_dict({'type': 'diffuse', 'reflectance': {'type': 'rgb', 'value': 0.3}})
    return meshes.shape(mesh, emitter=emitter, bsdf=dark)


def lamp_size(rng, room):
    """From bulbs to soft boxes."""
    return room * float(np.exp(rng.uniform(np.log(0.02), np.log(0.5))))


def spot(rng, position, target, power):
    return {'type': 'spot', 'intensity': {'type': 'rgb', 'value': (power * tint(rng)).tolist()}, 'cutoff_angle': float(rng.uniform(15, 50)),
            'to_world': mi.ScalarTransform4f().look_at(list(map(float, position)), list(map(float, target)), [0.1, 0.9, 0.2])}


def studio(rng):
    """A painted environment: a gradient with soft boxes."""
    y, x = np.mgrid[0:64, 0:128] / np.array([64, 128]).reshape(2, 1, 1)
    sky, ground = tint(rng) * rng.uniform(0.05, 1), tint(rng) * rng.uniform(0.0, 0.4)
    image = sky + (ground - sky) * (1 / (1 + np.exp(-20 * (y - 0.5))))[..., None]
    for _ in range(int(rng.integers(0, 5))):
        u, v, w, h = rng.random(), rng.uniform(0, 0.5), *rng.uniform(0.01, 0.1, 2)
        image = image + ((abs(x - u) < w) & (abs(y - v) < h))[..., None] * tint(rng) * np.exp(rng.uniform(0, 4))
    return {'bitmap': mi.Bitmap(image.astype(np.float32))}


def fill(rng):
    """A faint even light against lamps of about unit irradiance."""
    return {'type': 'constant', 'radiance': {'type': 'rgb', 'value': (np.exp(rng.uniform(np.log(0.01), np.log(0.2))) * tint(rng)).tolist()}}


def environment(rng, hdris):
    """A photographed sky or hall, a painted one, or an even one; z is up."""
    if rng.random() < 0.12:
        return {'type': 'constant', 'radiance': {'type': 'rgb', 'value': tint(rng).tolist()}}
    source = {'filename': str(rng.choice(hdris))} if len(hdris) and rng.random() < 0.75 else studio(rng)
    turn = mi.ScalarTransform4f().rotate([0, 0, 1], float(rng.uniform(0, 360))).rotate([1, 0, 0], 90)
    return {'type': 'envmap', 'to_world': turn} | source
