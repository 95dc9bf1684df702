"""Random surface materials as plugin dictionaries."""
import mitsuba as mi
import numpy as np

import textures

METALS = ('Au', 'Ag', 'Al', 'Cu', 'Cr', 'W')


def bitmap(image, tiles=1.0):
    image = np.atleast_3d(image).astype(np.float32)
    return {'type': 'bitmap', 'bitmap': mi.Bitmap(image), 'raw': True, 'to_uv': mi.ScalarTransform3f().scale([tiles, tiles])}


def tiling(rng):
    return float(np.exp(rng.uniform(np.log(0.7), np.log(6))))


def flat_colour(c):
    return {'type': 'rgb', 'value': [float(x) for x in c]}


def reflectance(rng, textured):
    return bitmap(textures.picture(rng), tiling(rng)) if rng.random() < textured else flat_colour(textures.colour(rng))


def roughness(rng):
    return float(np.exp(rng.uniform(np.log(0.02), np.log(0.6))))


def matte(rng, textured=0.6):
    return {'type': 'diffuse', 'reflectance': reflectance(rng, textured)}


def paint(rng):
    """A wall's: light."""
    return two_sided({'type': 'diffuse', 'reflectance': flat_colour(textures.colour(rng, low=0.3))})


def plastic(rng, textured=0.5):
    kind = {'type': 'plastic'} if rng.random() < 0.3 else {'type': 'roughplastic', 'alpha': roughness(rng)}
    return kind | {'diffuse_reflectance': reflectance(rng, textured), 'int_ior': float(rng.uniform(1.3, 1.8))}


def metal(rng):
    if rng.random() < 0.15:
        return {'type': 'conductor', 'material': 'none', 'specular_reflectance': flat_colour(rng.uniform(0.7, 0.95) * np.ones(3))}
    out = {'type': 'roughconductor', 'alpha': roughness(rng)}
    if rng.random() < 0.25:
        out['alpha'] = bitmap(0.03 + 0.5 * textures.grey(rng), tiling(rng))
    if rng.random() < 0.5:
        return out | {'material': str(rng.choice(METALS))}
    return out | {'material': 'none', 'specular_reflectance': reflectance(rng, 0.4)}


def glass(rng):
    ior = {'int_ior': float(rng.uniform(1.2, 1.8))}
    tint = {'specular_transmittance': flat_colour(rng.uniform(0.5, 1, 3))} if rng.random() < 0.5 else {}
    return rng.choice([{'type': 'dielectric'}, {'type': 'roughdielectric', 'alpha': roughness(rng)}, {'type': 'thindielectric'}]) | ior | tint


def blend(rng):
    """Two materials by a pattern: worn paint, inlays."""
    return {'type': 'blendbsdf', 'weight': bitmap(textures.grey(rng), tiling(rng)), 'a': matte(rng), 'b': metal(rng)}


def cutout(rng):
    """Leaves, lace, labels."""
    mask = textures.grey(rng)
    if rng.random() < 0.7:
        mask = (mask > np.quantile(mask, rng.uniform(0.2, 0.7))) * 1.0
    return {'type': 'mask', 'opacity': bitmap(mask, tiling(rng)), 'nested': two_sided(matte(rng))}


def bumpy(rng):
    base = plastic(rng) if rng.random() < 0.6 else metal(rng)
    return {'type': 'bumpmap', 'nested': base, 'scale': float(rng.uniform(0.02, 0.3)), 'texture': bitmap(textures.grey(rng), tiling(rng))}


def two_sided(bsdf):
    return {'type': 'twosided', 'nested': bsdf}


def surface(rng, textured=0.6):
    """An opaque material, seen from both sides."""
    pick = rng.choice(5, p=[0.42, 0.3, 0.16, 0.07, 0.05])
    return two_sided((lambda: matte(rng, textured), lambda: plastic(rng, textured), lambda: metal(rng), lambda: blend(rng), lambda: bumpy(rng))[pick]())


def anything(rng):
    pick = rng.random()
    return glass(rng) if pick < 0.1 else cutout(rng) if pick < 0.16 else surface(rng)
