"""Files of camera samples: deep, one sample per camera sample that hit, sorted by depth (channel names as the deep files of the
project have them). The k-th of spp weighs (1/spp)/(1 - k/spp), so that all flatten to the pixel's mean.
"""
import numpy as np
import OpenEXR

from frames import GROUPS, SUFFIXES, attributes, put

LENS = ('lens.U', 'lens.V')  # in [0, 1)^2
FLOATS = ('A', 'Z')  # the rest are halves


def ascending(z):
    """(samples,), sorted, as float32 with equal depths one step apart."""
    z = z.astype(np.float32)
    for k in range(1, len(z)):
        z[k] = max(z[k], np.nextafter(z[k - 1], np.float32(np.inf)))
    return z


def pixel(v, spp, camera):
    """{channel: values} of a pixel from the (samples, 15) values of what hit, in any order."""
    v = v[np.argsort(v[:, 12], kind='stable')]
    z = ascending(v[:, 12])
    alpha = (1 / spp) / (1 - np.arange(len(v)) / spp)
    premultiplied = v[:, :12] * alpha[:, None]
    out = {'A': alpha, 'Z': z, 'coc': camera.blur * np.abs(1 - camera.focus / z)}
    out |= dict(zip('RGB', (premultiplied[:, 0:3] + premultiplied[:, 3:6]).T)) | dict(zip(LENS, v[:, 13:15].T))
    for i, group in enumerate(GROUPS):
        out |= {f'{group}.{c}': premultiplied[:, 3 * i + k] for k, c in enumerate(SUFFIXES.get(group, 'RGB'))}
    return {name: x.astype(np.float32 if name in FLOATS else np.float16) for name, x in out.items()}


def write(path, camera, v, hit):
    """The samples (pixels, spp, 15) and which of them hit (pixels, spp), as frames.samples returns them."""
    spp = v.shape[1]
    pixels = [pixel(x[h], spp, camera) for x, h in zip(v, hit)]
    planes = {}
    for name in pixels[0]:
        plane = np.empty(len(pixels), object)
        for k, p in enumerate(pixels):
            plane[k] = p[name]
        planes[name] = plane.reshape(camera.height, camera.width)
    put(path, {'compression': OpenEXR.ZIPS_COMPRESSION, 'type': OpenEXR.deepscanline} | attributes(camera, spp), planes)
