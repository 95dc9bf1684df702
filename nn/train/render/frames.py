"""Noisy frames and references of one camera, and their files (channel names as the flat files of the project have them)."""
import os
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR

from camera import opaque
from trace import trace

GROUPS = ('diffuse', 'specular', 'albedo', 'N')
SUFFIXES = {'N': 'XYZ'}
LANES = 1 << 20  # camera paths in flight


@dataclass
class Look:
    """What one view's renders share."""
    exposure: float = 1.0  # factor on all light
    clamp: float = 20.0  # the most of a camera path, after exposure
    depth: int = 8  # bounces
    background: float = 0.0  # 1 where the environment is seen, 0 where it only lights


def paths(scene, camera, look, spp, seed):
    """spp consecutive camera paths per pixel, row by row: the 13 values of GROUPS and Z, two of the lens, and whether each hit.

    Light is exposed and clamped. Every caller gets all of it, evaluated: one kernel per scene.
    """
    n = camera.width * camera.height * spp
    sampler = mi.load_dict({'type': 'independent'})
    sampler.seed(dr.opaque(mi.UInt32, seed), n)
    index = dr.arange(mi.UInt32, n) // dr.opaque(mi.UInt32, spp)
    width = dr.opaque(mi.UInt32, camera.width)
    pixel = mi.Point2f(mi.Float(index % width), mi.Float(index // width)) + sampler.next_2d()
    lens = sampler.next_2d()
    p = trace(scene, sampler, camera.rays(pixel, lens), dr.opaque(mi.UInt32, look.depth), opaque(look.background))
    top = dr.max(p.diffuse + p.specular)
    s = dr.minimum(opaque(look.exposure), opaque(look.clamp) / dr.maximum(top, 1e-12))
    light = [dr.select(dr.isfinite(top), v * s, 0) for v in (*p.diffuse, *p.specular)]
    z = camera.depth(p.position)
    hit = p.hit & (z > 1e-4)
    values = light + [*p.albedo, *p.normal, dr.select(hit, z, 0), lens.x, lens.y]
    dr.eval(values, hit)
    return values, hit


def samples(scene, camera, look, spp, seed):
    """(pixels, spp, 15) of GROUPS, Z and the lens, and (pixels, spp) whether each hit."""
    values, hits = [], []
    pixels = camera.width * camera.height
    done = 0
    while done < spp:
        m = min(spp - done, max(1, LANES // pixels))
        v, hit = paths(scene, camera, look, m, seed + done)
        values.append(np.stack([np.array(x).reshape(pixels, m) for x in v], axis=-1))
        hits.append(np.array(hit).reshape(pixels, m))
        done += m
    return np.concatenate(values, axis=1), np.concatenate(hits, axis=1)


def named(group, values):
    return {f'{group}.{c}'.lstrip('.'): values[:, k] for k, c in enumerate(SUFFIXES.get(group, 'RGB'))}


def variance_of_mean(v):
    return v.var(axis=1, ddof=1) / v.shape[1]


def noisy(scene, camera, look, spp, seed):
    """All channels of a flat noisy file; spp >= 2."""
    v, hit = samples(scene, camera, look, spp, seed)
    colour = v[..., 0:3] + v[..., 3:6]
    count = hit.sum(1)
    mean_z = v[..., 12].sum(1) / np.maximum(count, 1)
    off = np.where(hit, v[..., 12] - mean_z[:, None], 0)
    parts = {'': colour, **{g: v[..., 3 * i:3 * i + 3] for i, g in enumerate(GROUPS)}}
    out = {'A': hit.mean(1), 'Z': mean_z,
           'variance.Z': np.where(count > 1, (off ** 2).sum(1) / np.maximum(count - 1, 1) / np.maximum(count, 1), 0)}
    for group, x in parts.items():
        out |= named(group, x.mean(1))
        out |= {'variance.' + k: c for k, c in named(group, variance_of_mean(x)).items()}
        if group != 'N':
            for half in (0, 1):
                out |= {f'half{half}.{k}': c for k, c in named(group, x[:, half::2].mean(1)).items()}
    return out


def relative_error(mean, variance):
    """The relative squared error that a mean of this variance has, averaged over the frame."""
    return float(np.mean(variance / (mean ** 2 + 0.01)))


def reference(scene, camera, look, spp, seed, enough=0.0):
    """The channels of a reference of at most spp paths per pixel, and their number: it ends early, though not before a third,
    once its own relative error is below `enough`."""
    pixels = camera.width * camera.height
    step = min(spp, max(1, LANES // pixels))
    done, sums, squares = 0, 0, 0
    while done < spp:
        values, hit = paths(scene, camera, look, step, seed + done)
        light = values[:6] + [values[k] + values[k + 3] for k in range(3)]
        v = light + values[6:13] + [dr.select(hit, mi.Float(1), 0)]
        total = lambda xs: np.stack([np.array(dr.block_reduce(dr.ReduceOp.Add, x, step), np.float64) for x in xs], axis=1)
        sums, squares, done = sums + total(v), squares + total([x * x for x in light]), done + step
        mean = sums / done
        variance = np.maximum(squares / done - mean[:, :9] ** 2, 0) / (done - 1)
        if done >= spp / 3 and relative_error(mean[:, 6:9], variance[:, 6:9]) < enough:
            break
    out = {'A': mean[:, 16], 'Z': sums[:, 15] / np.maximum(sums[:, 16], 1)}
    for group, k in (('diffuse', 0), ('specular', 3), ('', 6)):
        out |= named(group, mean[:, k:k + 3])
        out |= {'variance.' + n: c for n, c in named(group, variance[:, k:k + 3]).items()}
    return out | named('albedo', mean[:, 9:12]) | named('N', mean[:, 12:15]), done


def write(path, camera, spp, channels):
    """Whole or not at all. RGB, A, Z and variances are FLOAT, the rest HALF."""
    kind = lambda name: np.float32 if name in 'RGBAZ' or name.startswith('variance') else np.float16
    shape = camera.height, camera.width
    planes = {n: np.ascontiguousarray(c.reshape(shape).astype(kind(n))) for n, c in channels.items()}
    put(path, {'compression': OpenEXR.ZIP_COMPRESSION, 'type': OpenEXR.scanlineimage} | attributes(camera, spp), planes)


def attributes(camera, spp):
    return {'fathom:spp': spp, 'fathom:ppuScale': camera.scale, 'worldToCamera': camera.world_to_camera(), 'Software': f'Mitsuba {mi.__version__}'}


def put(path, header, planes):
    beside = f'{path}.{os.getpid()}.part'
    OpenEXR.File(header, planes).write(beside)
    os.replace(beside, path)
