"""Bitmaps of a drawing: where their pixels are, how large they are, and where on the drawing they lie.

It knows SVG as Inkscape understands it, and nothing of tiles. It needs Python's own library only.
"""

import base64
import binascii
import io
import os
import re
import struct
import urllib.parse
import urllib.request
from typing import NamedTuple

from smalti_program import Refused

#: User units in a unit of length. A percentage is one of the viewport and is dealt with by itself.
USER_UNITS = {
    "": 1.0,
    "px": 1.0,
    "pt": 4 / 3,
    "pc": 16.0,
    "in": 96.0,
    "cm": 96 / 2.54,
    "mm": 96 / 25.4,
    "Q": 24 / 25.4,
}

#: Parts of the free room that lie before a picture, by the words of preserveAspectRatio.
ALIGNED = {"Min": 0.0, "Mid": 0.5, "Max": 1.0}


class Rectangle(NamedTuple):
    """A rectangle in user units."""

    x: float
    y: float
    width: float
    height: float

    def cut_to(self, other):
        """What both have in common."""
        left, top = max(self.x, other.x), max(self.y, other.y)
        right = min(self.x + self.width, other.x + other.width)
        bottom = min(self.y + self.height, other.y + other.height)
        return Rectangle(left, top, right - left, bottom - top)


def source_of(href, absref, folders):
    """What the link of a bitmap leads to: the bytes of an embedded one, or the path of a file.

    ``absref`` is the absolute path that Inkscape may have noted beside the link. A relative link begins in one of the
    ``folders``. Raises Refused.
    """
    href = href.strip()
    if not href:
        raise Refused("it has no picture")
    if href[:5].lower() == "data:":
        return _embedded(href[5:])
    scheme = re.match(r"([A-Za-z][A-Za-z0-9+.-]+):", href)
    if scheme and scheme.group(1).lower() != "file":
        raise Refused(f"its picture is on another machine ({href}); save it, and import the file instead")
    places = [os.path.normpath(os.path.join(folder, path)) for folder in folders for path in _paths(href)]
    for place in places + ([absref] if absref else []):
        if os.path.isfile(place):
            return place
    raise Refused(f"the file that it is linked to is missing ({places[0]})")


def size_px(source):
    """Width and height of the bitmap in px, as its file has them; None if it is of a kind that is not read here.

    A photo that says how to hold it upright may have its sides exchanged.
    """
    try:
        with io.BytesIO(source) if isinstance(source, bytes) else open(source, "rb") as stream:
            size = _size(stream)
        return size if size and all(size) else None
    except (OSError, struct.error):
        # The program gives the reason.
        return None


def placed(image, natural, viewport):
    """The rectangle that the whole picture fills, and the part of it that is seen.

    ``image`` gives an attribute by its name, as ``get`` of an element does. ``natural`` is the size of the bitmap, and
    ``viewport`` that of the nearest view box. Raises Refused.
    """
    x, y = (_length(image.get(name), whole, 0.0) for name, whole in zip("xy", viewport))
    width, height = (
        _length(image.get(name), whole, side) for name, whole, side in zip(("width", "height"), viewport, natural)
    )
    if not (width > 0 and height > 0):
        raise Refused("it has no area on the drawing")
    frame = Rectangle(x, y, width, height)
    words = (image.get("preserveAspectRatio") or "").split()
    if words[:1] == ["none"]:
        return frame, frame
    across, down = width / natural[0], height / natural[1]
    scale = max(across, down) if "slice" in words else min(across, down)
    wide, high = natural[0] * scale, natural[1] * scale
    aligned = re.match(r"x(Min|Mid|Max)Y(Min|Mid|Max)$", words[0] if words else "")
    before, above = aligned.groups() if aligned else ("Mid", "Mid")
    picture = Rectangle(x + ALIGNED[before] * (width - wide), y + ALIGNED[above] * (height - high), wide, high)
    return picture, picture.cut_to(frame)


def viewport_of(svg):
    """Width and height of what percentages in an ``svg`` element are of, in user units."""
    box = re.split(r"[\s,]+", (svg.get("viewBox") or "").strip())
    if len(box) == 4:
        return float(box[2]), float(box[3])
    return tuple(_length(svg.get(name), 0.0, 0.0) for name in ("width", "height"))


def _embedded(data):
    """The bytes after ``data:``."""
    kind, comma, content = data.partition(",")
    if not comma:
        raise Refused("its embedded picture is damaged")
    if kind.lower().startswith("image/svg"):
        raise Refused("it is a drawing, and not a bitmap")
    content = urllib.parse.unquote_to_bytes(content)
    if not kind.lower().replace(" ", "").endswith(";base64"):
        return content
    content = re.sub(rb"\s+", b"", content).rstrip(b"=")
    try:
        return base64.b64decode(content + b"=" * (-len(content) % 4), validate=True)
    except binascii.Error as error:
        raise Refused("its embedded picture is damaged") from error


def _paths(href):
    """What a link may mean as a path: with its percentages decoded, or as it is written."""
    if href[:5].lower() != "file:":
        return list(dict.fromkeys((urllib.parse.unquote(href), href)))
    parts = urllib.parse.urlsplit(href)
    machine = "" if parts.netloc in ("", "localhost") else "//" + parts.netloc
    return [urllib.request.url2pathname(machine + parts.path)]


def _length(text, whole, missing):
    """A length in user units; ``whole`` is what 100 % are."""
    text = (text or "").strip()
    if text in ("", "auto"):
        return missing
    parts = re.match(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*([A-Za-z]*|%)$", text)
    if parts and parts.group(2) == "%":
        return float(parts.group(1)) / 100 * whole
    if not parts or parts.group(2) not in USER_UNITS:
        raise Refused(f"its place on the drawing is not understood ({text})")
    return float(parts.group(1)) * USER_UNITS[parts.group(2)]


def _size(stream):
    head = stream.read(32)
    if head.startswith(b"\x89PNG\r\n\x1a\n"):
        return struct.unpack(">II", head[16:24])
    if head.startswith(b"\xff\xd8"):
        return _size_of_jpeg(stream)
    if head.startswith((b"GIF87a", b"GIF89a")):
        return struct.unpack("<HH", head[6:10])
    if head.startswith(b"BM"):
        width, height = struct.unpack("<ii", head[18:26])
        # A negative height tells that the rows begin above.
        return width, abs(height)
    if head.startswith((b"II*\0", b"MM\0*")):
        return _size_of_tiff(stream, "<" if head.startswith(b"II") else ">")
    if head.startswith(b"RIFF") and head[8:12] == b"WEBP":
        return _size_of_webp(head)
    return None


def _size_of_jpeg(stream):
    stream.seek(2)
    while True:
        marker, kind, length = struct.unpack(">BBH", stream.read(4))
        if marker != 0xFF:
            return None
        # The headers of frames; the others in this row of numbers are tables.
        if 0xC0 <= kind <= 0xCF and kind not in (0xC4, 0xC8, 0xCC):
            height, width = struct.unpack(">xHH", stream.read(5))
            return width, height
        stream.seek(length - 2, os.SEEK_CUR)


def _size_of_tiff(stream, order):
    stream.seek(4)
    stream.seek(*struct.unpack(order + "I", stream.read(4)))
    sides = {}
    for _ in range(*struct.unpack(order + "H", stream.read(2))):
        tag, kind, _, value = struct.unpack(order + "HHI4s", stream.read(12))
        if tag in (256, 257):
            short = kind == 3
            (sides[tag],) = struct.unpack(order + ("H" if short else "I"), value[: 2 if short else 4])
    return (sides[256], sides[257]) if len(sides) == 2 else None


def _size_of_webp(head):
    if head[12:16] == b"VP8X":
        return tuple(1 + int.from_bytes(head[at : at + 3], "little") for at in (24, 27))
    if head[12:16] == b"VP8L":
        bits = int.from_bytes(head[21:25], "little")
        return 1 + (bits & 0x3FFF), 1 + (bits >> 14 & 0x3FFF)
    width, height = struct.unpack("<HH", head[26:30])
    return width & 0x3FFF, height & 0x3FFF
