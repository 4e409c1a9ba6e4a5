"""Makes the small pictures of this folder (not parrots.png). Needs Pillow and numpy.

Another version of Pillow may compress differently: then the hashes in tests/suite/files.rs change with the files.
"""
import struct
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).parent
WIDTH, HEIGHT = 63, 48


def picture():
    """Ramps, a disc and some noise, as floats in [0, 1] of shape (HEIGHT, WIDTH, 3)."""
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    rgb = np.stack([x / (WIDTH - 1), y / (HEIGHT - 1), 1 - x / (WIDTH - 1)], axis=-1)
    rgb[(x - 22) ** 2 + (y - 18) ** 2 < 150] = [0.9, 0.75, 0.1]
    noise = np.random.default_rng(7).normal(0, 0.02, rgb.shape)
    return np.clip(rgb + noise, 0, 1)


def s15_fixed16(*values):
    return b"".join(struct.pack(">i", round(value * 65536)) for value in values)


def icc_profile(color_space, tags):
    """An ICC version 2 display profile with these tags (signature, content)."""
    table, content, offset = b"", b"", 128 + 4 + 12 * len(tags)
    for signature, body in tags:
        body += b"\0" * (-len(body) % 4)
        table += signature + struct.pack(">II", offset + len(content), len(body))
        content += body
    body = struct.pack(">I", len(tags)) + table + content
    header = struct.pack(">I4sI4s4s4s", 128 + len(body), b"\0\0\0\0", 0x02400000, b"mntr", color_space, b"XYZ ")
    header += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + b"\0" * 28
    header += s15_fixed16(0.9642, 1.0, 0.8249)
    return header.ljust(128, b"\0") + body


def xyz(*values):
    return b"XYZ \0\0\0\0" + s15_fixed16(*values)


def gamma(value):
    return b"curv\0\0\0\0" + struct.pack(">IH", 1, round(value * 256))


def text(value):
    return b"desc\0\0\0\0" + struct.pack(">I", len(value) + 1) + value + b"\0" * 79


WIDE_RGB = icc_profile(b"RGB ", [
    (b"desc", text(b"wide RGB, gamma 2.2")), (b"cprt", b"text\0\0\0\0none\0"), (b"wtpt", xyz(0.9642, 1.0, 0.8249)),
    (b"rXYZ", xyz(0.60974, 0.31111, 0.01947)), (b"gXYZ", xyz(0.20528, 0.62567, 0.06087)),
    (b"bXYZ", xyz(0.14919, 0.06322, 0.74457)),
    (b"rTRC", gamma(2.19921875)), (b"gTRC", gamma(2.19921875)), (b"bTRC", gamma(2.19921875)),
])
LINEAR_GRAY = icc_profile(b"GRAY", [
    (b"desc", text(b"linear grey")), (b"cprt", b"text\0\0\0\0none\0"), (b"wtpt", xyz(0.9642, 1.0, 0.8249)),
    (b"kTRC", gamma(1.0)),
])


def write_float_tiff(path, rgb):
    """Pillow writes no RGB floats, so this is a TIFF of one strip by hand."""
    pixels = rgb.astype("<f4").tobytes()
    entries = [
        (256, 3, 1, WIDTH), (257, 3, 1, HEIGHT), (258, 3, 3, 8), (259, 3, 1, 1), (262, 3, 1, 2), (273, 4, 1, 20),
        (277, 3, 1, 3), (278, 3, 1, HEIGHT), (279, 4, 1, len(pixels)), (339, 3, 3, 14),
    ]
    head = struct.pack("<2sHI3H3H", b"II", 42, 20 + len(pixels), 32, 32, 32, 3, 3, 3)
    directory = struct.pack("<H", len(entries)) + b"".join(struct.pack("<HHII", *entry) for entry in entries)
    path.write_bytes(head + pixels + directory + b"\0\0\0\0")


def main():
    exact = picture()
    rgb = Image.fromarray(np.round(exact * 255).astype(np.uint8))
    grey = rgb.convert("L")
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    alpha = Image.fromarray(((x * 7 + y * 3) % 256).astype(np.uint8))
    exif = Image.Exif()
    exif[0x0112] = 6  # The upright picture is this one turned clockwise by a quarter.
    rgb.save(HERE / "plain.jpg", quality=88)
    rgb.save(HERE / "progressive.jpg", quality=88, progressive=True)
    rgb.save(HERE / "turned.jpg", quality=88, exif=exif)
    rgb.convert("CMYK").save(HERE / "cmyk.jpg", quality=88)
    rgb.save(HERE / "wide_rgb.png", icc_profile=WIDE_RGB)
    rgb.save(HERE / "wide_rgb.jpg", quality=88, icc_profile=WIDE_RGB)
    rgb.save(HERE / "broken_profile.png", icc_profile=WIDE_RGB[:150])
    grey.save(HERE / "linear_grey.png", icc_profile=LINEAR_GRAY)
    rgb.save(HERE / "rgb.png")
    grey.save(HERE / "grey.png")
    rgb.quantize(40).save(HERE / "palette.png")
    Image.merge("RGBA", (*rgb.split(), alpha)).save(HERE / "alpha.png")
    Image.fromarray(np.round(exact[..., 0] * 65535).astype(np.uint16)).save(HERE / "grey_16_bit.png")
    rgb.save(HERE / "lossy.webp", quality=80)
    rgb.save(HERE / "lossless.webp", lossless=True)
    rgb.save(HERE / "rgb.tif", compression="tiff_lzw")
    write_float_tiff(HERE / "float.tif", exact)
    rgb.save(HERE / "rgb.bmp")
    frames = [rgb.quantize(64), rgb.rotate(180).quantize(64)]
    frames[0].save(HERE / "two_frames.gif", save_all=True, append_images=frames[1:], duration=100)


if __name__ == "__main__":
    main()
