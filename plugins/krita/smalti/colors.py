"""Pixels in the colours of a layer and in those that smalti works in, 8 bits of sRGB.

Krita converts, in a document that is never shown.
"""

from collections import namedtuple

from krita import Krita

from .smalti_program import Refused

#: A colour space by the names that Krita has for its model, its depth and its profile.
Space = namedtuple("Space", "model depth profile")

#: What smalti takes an untagged picture for. The second name is that of the same curve and primaries.
SRGB = Space("RGBA", "U8", "sRGB-elle-V2-srgbtrc.icc")
SRGB_BUILT_IN = SRGB._replace(profile="sRGB built-in")


def space_of(owner):
    """The colour space of a node or of a document."""
    return Space(owner.colorModel(), owner.colorDepth(), owner.colorProfile())


def converted(pixels, width, height, source, target):
    """The pixels of a rectangle in another colour space."""
    if source == target or {source, target} == {SRGB, SRGB_BUILT_IN}:
        return pixels
    hidden = Krita.instance().createDocument(width, height, "smalti", *source, 72.0)
    if not hidden:
        raise Refused(f"Krita has no memory for a second picture of {width} x {height} px")
    try:
        # Krita takes another profile without a word if it does not know this one.
        if space_of(hidden) != source:
            raise Refused(f"Krita cannot convert from {source.profile}. Convert the picture to sRGB first")
        layer = hidden.topLevelNodes()[0]
        layer.setPixelData(pixels, 0, 0, width, height)
        if not hidden.setColorSpace(*target) or space_of(hidden) != target:
            raise Refused(f"Krita cannot convert to {target.profile}. Convert the picture to sRGB first")
        return layer.pixelData(0, 0, width, height).data()
    finally:
        hidden.close()


def rgba(pixels):
    """8-bit RGBA of BGRA, which is what Krita has in memory."""
    pixels = bytearray(pixels)
    pixels[0::4], pixels[2::4] = pixels[2::4], pixels[0::4]
    return pixels
