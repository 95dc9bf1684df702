"""Reads flat and deep EXR files, through OpenImageIO's or OpenEXR's Python module, whichever there is."""

import contextlib

import numpy as np

try:
    import OpenImageIO
except ImportError:
    OpenImageIO = None
    import OpenEXR


ATTRIBUTES = ("fathom:spp", "fathom:ppuScale")


def read(path):
    """The channels of the first part, {name: float32 (height, width)}, and the file's `fathom:spp` (None without)."""
    return (read_with_openimageio if OpenImageIO else read_with_openexr)(str(path))


def read_with_openimageio(path):
    file = OpenImageIO.ImageInput.open(path)
    if not file:
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
    with contextlib.closing(file):
        spec = file.spec()
        if spec.deep:
            raise OSError(f"{path}: expected flat pixels, found deep ones")
        pixels = file.read_image(OpenImageIO.FLOAT)
        if pixels is None:
            raise OSError(f"{path}: {file.geterror()}")
        channels = {name: np.ascontiguousarray(pixels[..., i]) for i, name in enumerate(spec.channelnames)}
        return channels, spec.getattribute("fathom:spp")


def read_with_openexr(path):
    try:
        part = OpenEXR.File(path, separate_channels=True).parts[0]
        channels = {name: np.asarray(channel.pixels, np.float32) for name, channel in part.channels.items()}
    except (RuntimeError, IndexError) as error:  # an incomplete file has no parts
        raise OSError(f"{path}: {error}") from error
    if any(pixels.ndim != 2 for pixels in channels.values()):
        raise OSError(f"{path}: expected flat pixels, found others")
    return channels, part.header.get("fathom:spp")


def read_deep(path):
    """The samples of the first part: how many a pixel has, (height, width); {name: float32 (S,)}, pixel after pixel; and {name: number} of
    the attributes in ATTRIBUTES that the file has."""
    return (read_deep_with_openimageio if OpenImageIO else read_deep_with_openexr)(str(path))


def read_deep_with_openimageio(path):
    file = OpenImageIO.ImageInput.open(path)
    if not file:
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
    with contextlib.closing(file):
        spec = file.spec()
        if not spec.deep:
            raise OSError(f"{path}: expected deep pixels, found flat ones")
        deep = file.read_native_deep_image()
        if deep is None:
            raise OSError(f"{path}: {file.geterror()}")
    counts = np.array([deep.samples(pixel) for pixel in range(spec.width * spec.height)], np.int64)
    places = [(pixel, k) for pixel, n in enumerate(counts.tolist()) for k in range(n)]
    value = deep.deep_value
    channels = {
        name: np.array([value(pixel, c, k) for pixel, k in places], np.float32) for c, name in enumerate(spec.channelnames)
    }  # fmt: skip
    attributes = {name: spec.getattribute(name) for name in ATTRIBUTES if spec.getattribute(name) is not None}
    return counts.reshape(spec.height, spec.width), channels, attributes


def read_deep_with_openexr(path):
    try:
        part = OpenEXR.File(path, separate_channels=True).parts[0]
        planes = {name: channel.pixels for name, channel in part.channels.items()}
    except (RuntimeError, IndexError) as error:
        raise OSError(f"{path}: {error}") from error
    if any(pixels.dtype != object for pixels in planes.values()):
        raise OSError(f"{path}: expected deep pixels, found flat ones")
    filled = {name: [x for x in pixels.ravel() if x is not None] for name, pixels in planes.items()}
    counts = np.array([0 if x is None else len(x) for x in planes["Z"].ravel()], np.int64)
    channels = {name: np.concatenate([*x, []]).astype(np.float32) for name, x in filled.items()}
    attributes = {name: part.header[name] for name in ATTRIBUTES if name in part.header}
    return counts.reshape(planes["Z"].shape), channels, attributes


def write_deep(path, counts, channels, attributes):
    """Writes samples as `read_deep` returns them; the tests make their frames with it."""
    height, width = counts.shape
    if not OpenImageIO:
        header = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": OpenEXR.deepscanline, **attributes}
        planes, ends = {}, np.cumsum(counts.ravel())
        for name, values in channels.items():
            planes[name] = np.empty(counts.size, object)
            for pixel, x in enumerate(np.split(np.asarray(values, np.float32), ends[:-1])):
                planes[name][pixel] = x
            planes[name] = planes[name].reshape(height, width)
        OpenEXR.File(header, planes).write(str(path))
        return
    spec = OpenImageIO.ImageSpec(width, height, len(channels), OpenImageIO.FLOAT)
    spec.channelnames, spec.deep = tuple(channels), True
    for name, value in attributes.items():
        spec.attribute(name, value)
    deep = OpenImageIO.DeepData()
    deep.init(spec)
    start = 0
    for pixel, n in enumerate(counts.ravel().tolist()):
        deep.set_samples(pixel, n)
        for c, values in enumerate(channels.values()):
            for k in range(n):
                deep.set_deep_value(pixel, c, k, float(values[start + k]))
        start += n
    file = OpenImageIO.ImageOutput.create(str(path))
    if not (file and file.open(str(path), spec) and file.write_deep_image(deep) and file.close()):
        raise OSError(f"{path}: {OpenImageIO.geterror()}")


def write(path, channels):
    """Writes {name: float32 (height, width)}; the tests make their frames with it."""
    if not OpenImageIO:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {name: np.ascontiguousarray(x, np.float32) for name, x in channels.items()}).write(str(path))
        return
    height, width = next(iter(channels.values())).shape
    spec = OpenImageIO.ImageSpec(width, height, len(channels), OpenImageIO.FLOAT)
    spec.channelnames = tuple(channels)
    file = OpenImageIO.ImageOutput.create(str(path))
    pixels = np.ascontiguousarray(np.stack(list(channels.values()), -1), np.float32)
    if not (file and file.open(str(path), spec) and file.write_image(pixels) and file.close()):
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
