"""Reads flat EXR files, through OpenImageIO's or OpenEXR's Python module, whichever there is."""

import contextlib

import numpy as np

try:
    import OpenImageIO
except ImportError:
    OpenImageIO = None
    import OpenEXR


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


def write(path, channels):
    """Writes {name: float32 (height, width)}; the tests make their frames with it."""
    if not OpenImageIO:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        OpenEXR.File(header, {name: np.asarray(x, np.float32) for name, x in channels.items()}).write(str(path))
        return
    height, width = next(iter(channels.values())).shape
    spec = OpenImageIO.ImageSpec(width, height, len(channels), OpenImageIO.FLOAT)
    spec.channelnames = tuple(channels)
    file = OpenImageIO.ImageOutput.create(str(path))
    pixels = np.ascontiguousarray(np.stack(list(channels.values()), -1), np.float32)
    if not (file and file.open(str(path), spec) and file.write_image(pixels) and file.close()):
        raise OSError(f"{path}: {OpenImageIO.geterror()}")
