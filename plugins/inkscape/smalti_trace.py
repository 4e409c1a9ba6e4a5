#!/usr/bin/env python3
"""An extension of Inkscape that lays a group of evolved tiles over each selected bitmap.

The program smalti makes the tiles, as SVG. What is done here: find the pixels of a bitmap, have them evolved, and fit
the drawing that comes back into the one that is open. Where a bitmap lies is told by smalti_bitmaps.py.
"""

import contextlib
import io
import os
import re
import select
import signal
import sys
import urllib.parse

import inkex
from lxml import etree

import smalti_bitmaps as bitmaps
import smalti_program as program
from smalti_program import Refused

#: Properties of a bitmap that its tiles share.
SHARED = ("opacity", "display", "visibility", "mix-blend-mode", "isolation")

#: Properties that mean another thing in the coordinates of the tiles, and so get a group of their own.
OUTER = ("clip-path", "mask", "filter")

#: What tiles say nothing of must not come from the layer that they are laid in.
OWN = {"stroke": "none", "fill-opacity": "1"}

#: Elements with content that is drawn only where another element asks for it.
NOT_DRAWN = ("defs", "clipPath", "mask", "pattern", "symbol", "marker")

#: Elements of the program's SVG that are no part of the picture. Its metadata stays out, too: it marks a file as one
#: that the program may write anew, and a drawing of somebody's is none.
NOT_TAKEN = ("metadata", "title")


class Trace(inkex.EffectExtension):
    """Trace Bitmap into Tiles."""

    def add_arguments(self, pars):
        pars.add_argument("--tab")
        pars.add_argument("--style", default="mosaic")
        pars.add_argument("--mask", default="auto")
        pars.add_argument("--tiles", type=int, default=0)
        pars.add_argument("--grout", default="style")
        pars.add_argument("--grout_color", type=color, default="#808080")
        pars.add_argument("--remove", type=inkex.Boolean, default=False)
        pars.add_argument("--evals", type=int, default=0)
        pars.add_argument("--size", type=int, default=512)
        pars.add_argument("--seed", type=int, default=0)
        pars.add_argument("--program", default="")

    def effect(self):
        try:
            smalti = program.find(self.options.program.strip())
            # What can be refused at once is, and all are made before the first is laid: a failure leaves the drawing as
            # it was.
            found = [(image, self.source_of(image)) for image in self.selected_bitmaps()]
            made = [(image, *self.traced(smalti, image, source)) for image, source in found]
        except Refused as refused:
            raise inkex.AbortExtension(str(refused)) from refused
        except program.Cancelled:
            # Nobody listens any more.
            sys.exit(1)
        for image, tiles, place in made:
            self.lay(image, tiles, place)

    def selected_bitmaps(self):
        """The bitmaps that are selected or inside of what is selected, each once and the lowest first."""
        if not self.options.ids:
            raise Refused("Select a bitmap first")
        kind = inkex.addNS("image", "svg")
        selected = [self.svg.getElementById(name) for name in self.options.ids]
        chosen = {image for element in selected for image in element.iter(kind)}
        images = [image for image in self.svg.iter(kind) if image in chosen and is_drawn(image)]
        if images:
            return images
        if all(isinstance(element, inkex.Use) for element in selected):
            raise Refused("A clone has no bitmap of its own; select its original, or unlink it with Edit > Clone")
        raise Refused("Select a bitmap first: there is none in what is selected")

    def source_of(self, image):
        """The bytes of the bitmap, or the path of its file."""
        with named(image):
            source = bitmaps.source_of(href_of(image), image.get("sodipodi:absref"), self.folders())
            place_of(image, bitmaps.size_px(source) or (1, 1))
        return source

    def traced(self, smalti, image, source):
        """The SVG of a bitmap's tiles, and the rectangles where they lie and are seen."""
        options = self.options
        asked = program.Options(
            style=options.style,
            tiles=options.tiles,
            seed=options.seed,
            mask=options.mask,
            grout=options.grout,
            grout_color=options.grout_color,
            evals=options.evals,
            size=options.size,
        )
        with named(image):
            svg = program.evolve(smalti, source, asked, kind="svg", progress=lambda share: is_awaited())
        tiles = inkex.load_svg(io.BytesIO(svg)).getroot()
        how = etree.Element(inkex.addNS("desc", "svg"))
        how.text = " ".join(["smalti evolve", *asked.arguments()])
        tiles.insert(0, how)
        return tiles, place_of(image, natural_size(source, tiles))

    def folders(self):
        """Where relative links may begin.

        An extension gets a copy of the drawing in a temporary folder, and Inkscape has made the links relative to that.
        """
        of_copy = os.path.dirname(os.path.abspath(str(self.options.input_file)))
        return [of_copy, *filter(None, [self.svg_path()])]

    def lay(self, image, tiles, place):
        """Puts the tiles right above the bitmap, or into its place."""
        prefix = free_prefix(self.svg)
        rename(tiles, prefix)
        group = self.group_of(tiles, place, prefix)
        label = f"{name_of(image)} in tiles"
        group.set("inkscape:label", label)
        group.set("id", prefix)
        group.style.update({name: given(image, name) for name in SHARED if given(image, name)})
        outermost = group
        outer = {name: given(image, name) for name in OUTER if given(image, name) not in (None, "none")}
        if outer:
            outermost = inkex.Group()
            outermost.append(group)
            outermost.set("id", f"{prefix}-whole")
            outermost.set("inkscape:label", label)
            outermost.attrib.update(outer)
        # In a group of their own, clip, mask and filter have the coordinates that they had at the bitmap.
        outermost.set("transform", matrix(image.transform @ outermost.transform))
        parent = image.getparent()
        parent.insert(parent.index(image) + 1, outermost)
        if self.options.remove:
            # Clones of the bitmap, and the selection, go on with what has taken its place.
            name = image.get_id()
            parent.remove(image)
            outermost.set("id", name)

    def group_of(self, tiles, place, prefix):
        """The picture as a group that is cut where the SVG of the program ends, with its definitions in the drawing's.

        There they outlive the group: a copy of it still needs them when the first is deleted.
        """
        left, top, width, height = (float(number) for number in tiles.get("viewBox").split())
        whole, seen = place
        across, down = whole.width / width, whole.height / height
        group = inkex.Group(style=str(inkex.Style(OWN)))
        group.set("transform", matrix((across, 0, 0, down, whole.x - left * across, whole.y - top * down)))
        for child in list(tiles):
            kind = local_name(child)
            if kind == "defs":
                self.svg.defs.extend(list(child))
            elif kind == "clipPath":
                self.svg.defs.append(child)
            elif kind not in NOT_TAKEN:
                child.tail = None
                group.append(child)
        frame = etree.SubElement(self.svg.defs, inkex.addNS("clipPath", "svg"), id=f"{prefix}-frame")
        sides = {
            "x": (seen.x - whole.x) / across + left,
            "y": (seen.y - whole.y) / down + top,
            "width": seen.width / across,
            "height": seen.height / down,
        }
        etree.SubElement(frame, inkex.addNS("rect", "svg"), {name: f"{side:.12g}" for name, side in sides.items()})
        group.set("clip-path", f"url(#{prefix}-frame)")
        return group


def color(text):
    """``#rrggbb`` of a colour as Inkscape gives it: a number of 32 bits that ends with alpha, or digits after ``#``."""
    return text[:7] if text.startswith("#") else f"#{(int(text) & 0xFFFFFFFF) >> 8:06x}"


def matrix(transform):
    """A transform in more digits than inkex writes: a unit of the tiles is a small part of a pixel."""
    numbers = " ".join(f"{number:.12g}" for number in inkex.Transform(transform).to_hexad())
    return f"matrix({numbers})"


def local_name(element):
    return etree.QName(element).localname if isinstance(element.tag, str) else ""


def is_drawn(image):
    return not any(local_name(ancestor) in NOT_DRAWN for ancestor in image.iterancestors())


def href_of(image):
    return image.get("href") or image.get("xlink:href") or ""


def place_of(image, natural):
    viewport = bitmaps.viewport_of(next(image.iterancestors(inkex.addNS("svg", "svg"))))
    return bitmaps.placed(image, natural, viewport)


@contextlib.contextmanager
def named(image):
    """What is refused inside tells which bitmap it is about."""
    try:
        yield
    except Refused as refused:
        # An embedded bitmap goes to the program without a name.
        reason = str(refused).replace("/dev/stdin: ", "")
        raise Refused(f"No tiles for the bitmap {name_of(image)}: {reason}") from refused


def given(image, name):
    """A property as the bitmap's own style or attribute has it."""
    return image.style.get(name) or image.get(name)


def name_of(image):
    """What a person calls the bitmap: its label, its file, or its id."""
    href = href_of(image)
    file_name = "" if href[:5].lower() == "data:" else os.path.basename(urllib.parse.unquote(href))
    return image.get("inkscape:label") or os.path.splitext(file_name)[0] or image.get("id")


def natural_size(source, tiles):
    """The size of a bitmap in px, as it is held upright; of a kind of files that is not known, about that size."""
    evolved = float(tiles.get("width")), float(tiles.get("height"))
    size = bitmaps.size_px(source) or evolved
    wide = evolved[0] / evolved[1]
    return min((size, size[::-1]), key=lambda sides: abs(sides[0] / sides[1] - wide))


def free_prefix(svg):
    """The first of smalti-1, smalti-2, .. that is above all ids of the drawing that begin so."""
    taken = (re.match(r"smalti-(\d+)", name) for name in svg.xpath("//@id"))
    return f"smalti-{1 + max((int(number.group(1)) for number in taken if number), default=0)}"


def rename(tiles, prefix):
    """Begins each id with ``prefix``, and what refers to it: two pictures in one drawing have the same ids."""
    for element in tiles.iter(etree.Element):
        for name, value in element.attrib.items():
            if name == "id":
                element.set(name, f"{prefix}-{value}")
            elif name.endswith("href") and value.startswith("#"):
                element.set(name, f"#{prefix}-{value[1:]}")
            elif value.startswith("url(#"):
                element.set(name, f"url(#{prefix}-{value[5:]}")


def is_awaited():
    """Whether Inkscape still reads what this extension will write.

    When somebody presses Cancel, or Inkscape itself ends, some of its versions only close their end of the pipe. Others
    send a signal, too. Windows does not tell.
    """
    if not hasattr(select, "poll"):
        return True
    poll = select.poll()
    poll.register(sys.stdout.fileno(), 0)
    return not poll.poll(0)


def stop(number, frame):
    raise program.Cancelled


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, stop)
    Trace().run()
