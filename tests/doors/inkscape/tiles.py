"""Checks that the tiles in a drawing are those of the program, and that two pictures in one drawing stay apart."""

import os
from urllib.parse import quote_from_bytes

from lxml import etree
from room import LABEL, LINK, QUICK, SVG, all_ids, by_id, check, drawing, embedded, end, flags, kept, own, photo, pixels
from room import references, told, traced


def parts(svg):
    """The definitions and the drawn elements of the program's SVG, each as text."""
    definitions, drawn = [], []
    for element in etree.fromstring(svg).iterchildren(etree.Element):
        kind = etree.QName(element).localname
        if kind == "defs":
            definitions += [told(child) for child in element]
        elif kind == "clipPath":
            definitions.append(told(element))
        elif kind not in ("title", "metadata"):
            drawn.append(told(element))
    return definitions, drawn


def parts_of(root, name):
    """The same of a traced group, whose definitions are those of the drawing."""
    definitions = [
        told(element, name)
        for element in root.find(SVG + "defs")
        if element.get("id").startswith(name + "-") and element.get("id") != name + "-frame"
    ]
    drawn = [told(element, name) for element in by_id(root, name) if element.tag != SVG + "desc"]
    return definitions, drawn


def same_tiles(what, svg, root, name):
    (wanted_definitions, wanted), (definitions, found) = parts(svg), parts_of(root, name)
    check(what, found == wanted, f"{len(found)} elements are not the {len(wanted)} of the program")
    if wanted_definitions:
        check(f"{what}, and so are its shapes", definitions == wanted_definitions, f"{definitions}"[:300])


def image(source, name="photo", size=(63, 48), more='x="20" y="30"'):
    return (
        f'<image id="{name}" {more} width="{size[0]}" height="{size[1]}" preserveAspectRatio="none" '
        f'xlink:href="{source}"/>'
    )


picture = photo("rgb.png")

# As the program makes it, at the size of the picture.
path = drawing(image(embedded(picture), more=""), 'width="63" height="48" viewBox="0 0 63 48"')
root = traced(path, "photo")
group = by_id(root, "smalti-1")
same_tiles("an embedded bitmap becomes the program's tiles", own(picture), root, "smalti-1")
check("they are named after the bitmap", group.get(LABEL) == "photo in tiles", group.get(LABEL))
check("they lie right above the bitmap", group.getprevious().get("id") == "photo", group.getprevious().attrib)
how = group.findtext(SVG + "desc")
wanted = " ".join(["smalti evolve", *flags({"style": "mosaic", "seed": 0, "size": 512, **QUICK})])
check("they tell how they were made", how == wanted, how)
check("no bitmap is in them", not group.findall(f".//{SVG}image"))
with open("own.svg", "wb") as file:
    file.write(own(picture))
difference = abs(pixels("traced.svg") - pixels("own.svg")).max()
check("Inkscape draws them as it draws the program's SVG", difference == 0, f"up to {difference} of 255 apart")
left = [name for name in os.listdir(os.environ["TMPDIR"]) if not name.startswith("xvfb-run")]
check("Inkscape and the extension leave no file behind", not left, left)

# Percentages instead of base64; the other shapes, grout and styles, through the settings of the dialog.
percent = drawing(image("data:image/png," + quote_from_bytes(picture)))
root = traced(percent, "photo", style="paint", seed=7)
same_tiles("a bitmap embedded with percentages", own(picture, style="paint", seed=7), root, "smalti-1")
root = traced(drawing(image(embedded(picture))), "photo", mask="flower", grout="color", grout_color=0xAA3311FF)
wanted = own(picture, mask="flower", grout="#aa3311")
same_tiles("flowers with grout of a colour", wanted, root, "smalti-1")
clear = photo("alpha.png")
root = traced(drawing(image(embedded(clear))), "photo", style="spray", size=40)
same_tiles("a transparent bitmap, sprayed", own(clear, style="spray", size=40), root, "smalti-1")

# Two at once, and one of them again.
upper = photo("plain.jpg")
two = image(embedded(picture), "one", more='x="5"') + image(embedded(upper, "image/jpeg"), "two", more='x="99"')
root = traced(drawing(two), "two,one", mask="hexagon")
same_tiles("the lower of two bitmaps", own(picture, mask="hexagon"), root, "smalti-1")
same_tiles("the upper of two bitmaps", own(upper, mask="hexagon"), root, "smalti-2")
root = traced(kept("twice.svg"), "one", mask="disc")
same_tiles("a bitmap traced again", own(picture, mask="disc"), root, "smalti-3")
same_tiles("the tiles of before beside it", own(picture, mask="hexagon"), root, "smalti-1")
names = all_ids(root)
check("all ids in the drawing are different", len(names) == len(set(names)))
lost = set(references(root)) - set(names)
check("all references lead somewhere", not lost and len(references(root)) > 200, lost)
root = traced(kept("thrice.svg"), "smalti-3,two")
alone = by_id(root, "smalti-4") is not None and by_id(root, "smalti-5") is None
check("a group of tiles that is selected with a bitmap stays as it is", alone)

# A copy must outlive what it was copied from.
copy = ["select-clear", "select-by-id:smalti-1", "duplicate", "select-clear", "select-by-id:smalti-1", "delete"]
root = traced(drawing(image(embedded(picture))), "photo", *copy, mask="disc")
copies = [element for element in root.iter(SVG + "g") if element.get(LABEL) == "photo in tiles"]
lost = set(references(root)) - set(all_ids(root))
check("a duplicate needs nothing of its original", len(copies) == 1 and not lost, f"{len(copies)} groups, {lost}")

# The bitmap goes.
clone = image(embedded(picture)) + '<use id="clone" xlink:href="#photo" y="60"/>'
root = traced(drawing(clone), "photo", remove="true")
check("the bitmap is removed if that is wanted", not root.findall(f".//{SVG}image"))
taken = by_id(root, "photo")
check("the tiles take its place", taken.tag == SVG + "g" and by_id(root, "clone").get(LINK) == "#photo", taken.attrib)

# Undo and redo.
root = traced(drawing(image(embedded(picture))), "photo", "undo", remove="true")
left = [name for name in all_ids(root) if name.startswith("smalti")]
back = by_id(root, "photo").tag == SVG + "image"
check("one undo brings the bitmap back and takes the tiles away", back and not left, left)
root = traced(drawing(image(embedded(picture))), "photo", "undo", "redo")
same_tiles("redo brings the tiles back", own(picture), root, "smalti-1")

# Bitmaps in groups; bitmaps that only others draw.
nested = f'<g id="outer"><g>{image(embedded(picture))}</g><clipPath id="c"><rect width="9" height="9"/></clipPath></g>'
root = traced(drawing(nested), "outer")
check("a bitmap in a selected group is traced there", by_id(root, "smalti-1").getprevious().get("id") == "photo")

end()
