"""Checks that tiles cover what their bitmap covered, whatever places it on a drawing, and however it is linked."""

import os
import shutil
import urllib.parse

import numpy
from room import PHOTOS, SVG, by_id, check, drawing, embedded, end, kept, photo, pixels, smalti_program, told, traced

#: Longer sides in px at which pictures evolve here: below that of the bitmaps, so that their proportions are rounded.
SIZE = 45


def compare(what, before, after):
    """Whether two drawings cover the same area, and have nearly the same colours on it."""
    covered = [rgba[..., 3] for rgba in (before, after)]
    # The edge of a bitmap and that of a clip may be smoothed differently.
    far = (abs(covered[0] - covered[1]) > 140).sum()
    share = abs(covered[0].mean() - covered[1].mean()) / covered[0].mean()
    check(f"{what}: the same area", far == 0 and share < 0.01, f"{far} px differ, and {share:.2%} of the area")
    height, width = (side // 8 * 8 for side in before.shape[:2])
    blocks = [rgba[:height, :width].reshape(height // 8, 8, width // 8, 8, 4).mean((1, 3)) for rgba in (before, after)]
    apart = numpy.percentile(abs(blocks[0] - blocks[1]).max(2), 95)
    check(f"{what}: the same colours", apart < 48, f"{apart:.0f} of 255 apart")


def square(columns, rows, colours):
    """A PNG of flat rectangles, as bytes."""
    width, height = 64, 32
    line = [b"".join(bytes(colours[row * columns + x * columns // width]) for x in range(width)) for row in range(rows)]
    return smalti_program.png(width, height, 3, b"".join(line[y * rows // height] for y in range(height)))


flat = embedded(square(2, 2, [(220, 40, 30), (40, 160, 60), (40, 60, 200), (240, 220, 60)]))
turned, upright = embedded(photo("turned.jpg"), "image/jpeg"), embedded(photo("rgb.png"))
STRETCHED = 'preserveAspectRatio="none"'
TALL = 'x="5" y="5" width="60" height="90"'
ROOM = 'x="5" y="5" width="100" height="100"'
FITTED = f'x="5" y="16.905" width="100" height="76.19" {STRETCHED}'

#: A bitmap; and where this is another, one that covers the same. Inkscape 1.2 smears the edges of a fitted bitmap over
#: the rest of its box, and does not read WebP.
CASES = {
    "stretched": [(f'x="7.5" y="11" width="80" height="60" {STRETCHED}', flat)],
    "fitted into the middle": [(TALL, flat), (f'x="5" y="35" width="60" height="30" {STRETCHED}', flat)],
    "fitted above": [
        (f'{TALL} preserveAspectRatio="xMinYMin meet"', flat),
        (f'x="5" y="5" width="60" height="30" {STRETCHED}', flat),
    ],
    "fitted below": [
        (f'{TALL} preserveAspectRatio="xMidYMax"', flat),
        (f'x="5" y="65" width="60" height="30" {STRETCHED}', flat),
    ],
    "cut on the left": [(f'{TALL} preserveAspectRatio="xMaxYMid slice"', flat)],
    "cut below": [('x="5" y="5" width="110" height="30" preserveAspectRatio="xMidYMin slice"', flat)],
    "in millimetres and percent": [(f'x="3mm" y="4%" width="0.8in" height="12%" {STRETCHED}', flat)],
    "without a size": [('x="12" y="20"', flat)],
    "transformed": [
        (f'x="20" y="10" width="60" height="40" {STRETCHED} transform="rotate(20) skewX(15) scale(.9 1.2)"', flat)
    ],
    "clipped": [
        (f'x="5" y="5" width="90" height="80" {STRETCHED} clip-path="url(#round)" transform="rotate(9)"', flat)
    ],
    "masked": [(f'x="5" y="5" width="90" height="80" {STRETCHED} style="mask:url(#soft)"', flat)],
    "half transparent": [(f'x="9" y="9" width="90" height="80" {STRETCHED} style="opacity:.5"', flat)],
    "blurred": [(f'x="9" y="9" width="90" height="80" {STRETCHED} style="filter:url(#blur)"', flat)],
    "held upright by its EXIF": [(ROOM, turned), (f'x="16.905" y="5" width="76.19" height="100" {STRETCHED}', turned)],
    "in a WebP": [(ROOM, embedded(photo("lossy.webp"), "image/webp")), (FITTED, upright)],
    "in a lossless WebP": [(ROOM, embedded(photo("lossless.webp"), "image/webp")), (FITTED, upright)],
    "in a GIF": [(ROOM, embedded(photo("two_frames.gif"), "image/gif")), (FITTED, upright)],
    "in a BMP": [(ROOM, embedded(photo("rgb.bmp"), "image/bmp")), (FITTED, upright)],
    "in a TIFF": [(ROOM, embedded(photo("rgb.tif"), "image/tiff")), (FITTED, upright)],
}
DEFINED = (
    '<defs><clipPath id="round"><circle cx="50" cy="45" r="40"/></clipPath><mask id="soft" maskUnits="userSpaceOnUse" '
    'x="0" y="0" width="120" height="110"><rect width="60" height="110" fill="#fff"/></mask>'
    '<filter id="blur"><feGaussianBlur stdDeviation="4"/></filter></defs>'
)

# All of them on one drawing, each in a field of its own, in a view box that begins elsewhere.
HEAD = 'width="540" height="605" viewBox="-20 -10 540 605"'


def fields(which):
    images = (
        f'<g transform="translate({number % 4 * 125} {number // 4 * 115})" stroke="#f0f" stroke-width="3">'
        f'<image id="case{number}" {case[which][0]} xlink:href="{case[which][1]}"/></g>'
        for number, case in enumerate(CASES.values())
    )
    return DEFINED + "".join(images)


before = pixels(drawing(fields(-1), HEAD))
everything = ",".join(f"case{number}" for number in range(len(CASES)))
root = traced(drawing(fields(0), HEAD), everything, remove="true", style="free", size=SIZE, tiles=120, evals=20000)
check("no bitmap is left of all that were removed", not root.findall(f".//{SVG}g/{SVG}image"))
after = pixels(kept("covered.svg"))
for number, what in enumerate(CASES):
    left, top = 20 + number % 4 * 125, 10 + number // 4 * 115
    field = slice(max(0, top - 4), top + 108), slice(left - 10, left + 115)
    compare(what, before[field], after[field])

# Percentages of an inner drawing.
inner = '<svg x="50" y="20" width="100" height="100" viewBox="0 0 10 20"><image id="case" x="10%" y="2" width="50%" '
path = drawing(f'{inner} height="50%" preserveAspectRatio="none" xlink:href="{flat}"/></svg>')
before = pixels(path)
traced(path, "case", remove="true", style="free", size=SIZE, tiles=120, evals=20000)
compare("in a drawing in the drawing", before, pixels("traced.svg"))

# Links.
os.makedirs("elsewhere", exist_ok=True)
shutil.copy(os.path.join(PHOTOS, "rgb.png"), "elsewhere/a photo, 50%.png")
shutil.copy(os.path.join(PHOTOS, "rgb.png"), "beside.png")
absolute = os.path.abspath("elsewhere/a photo, 50%.png")
root = traced(drawing(f'<image id="p" xlink:href="{embedded(photo("rgb.png"))}"/>'), "p")
wanted = [told(element) for element in by_id(root, "smalti-1")]
quoted = urllib.parse.quote(absolute)
LINKS = {
    "beside the drawing": 'xlink:href="beside.png"',
    "by a name with percentages": 'xlink:href="elsewhere/a%20photo,%2050%25.png"',
    "by an absolute path": f'xlink:href="{quoted}"',
    "by a file address": f'xlink:href="file://{quoted}"',
    "in the words of SVG 2": f'href="file://{quoted}"',
    "by the path that Inkscape noted": f'xlink:href="gone.png" sodipodi:absref="{absolute}"',
}
for what, link in LINKS.items():
    root = traced(drawing(f'<image id="p" width="9" height="9" {link}/>'), "p")
    found = [told(element) for element in by_id(root, "smalti-1")]
    check(f"a bitmap that is linked {what}", found == wanted, f"{len(found)} elements are not {len(wanted)}")
still = by_id(traced(drawing(f'<image id="p" {LINKS["beside the drawing"]}/>'), "p"), "p").attrib.values()
check("the link of a bitmap stays as it was", "beside.png" in still, still)

end()
