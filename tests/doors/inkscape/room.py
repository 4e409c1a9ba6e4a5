"""What the checks share: Inkscape on a drawing, what is in a drawing, its pixels, and what the program itself makes."""

import base64
import os
import subprocess
import sys

import numpy
from lxml import etree

PHOTOS, EXTENSION = sys.argv[1:3]
sys.path.insert(0, EXTENSION)
import smalti_program  # noqa: E402, F401 - the checks take it from here.

PROGRAM = os.environ["SMALTI"]
SVG = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"
LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"

#: Few tiles and a short search: what is tested is where they go.
QUICK = {"tiles": 80, "evals": 3000}

_failed = []


def check(what, passed, why=""):
    """One line for one check."""
    print(f"ok - {what}" if passed else f"NOT ok - {what}: {why}", flush=True)
    if not passed:
        _failed.append(what)


def end():
    sys.exit(f"{len(_failed)} checks failed" if _failed else 0)


def photo(name):
    with open(os.path.join(PHOTOS, name), "rb") as file:
        return file.read()


def embedded(content, kind="image/png"):
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def flags(options):
    """Options of the dialog as flags of the program."""
    return [word for name, value in options.items() for word in (f"--{name}", str(value))]


def own(picture, **options):
    """The SVG that the program makes of the bytes of a picture."""
    command = [PROGRAM, "evolve", "-", "-o", "-", "--format", "svg", *flags({**QUICK, "style": "mosaic", **options})]
    return subprocess.run(command, input=picture, capture_output=True, check=True).stdout


def drawing(content, head='width="200" height="200" viewBox="0 0 200 200"', name="drawing.svg"):
    """Writes a drawing; returns its path."""
    with open(name, "w", encoding="utf-8") as file:
        file.write(
            '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
            'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape" '
            'xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" '
            f"{head}>{content}</svg>"
        )
    return os.path.abspath(name)


def set_in_the_dialog(**options):
    """Leaves in Inkscape's settings what somebody chose in the dialog the last time."""
    folder = os.path.join(os.environ["XDG_CONFIG_HOME"], "inkscape")
    values = " ".join(f'smalti.trace.{name}="{value}"' for name, value in options.items())
    with open(os.path.join(folder, "preferences.xml"), "w", encoding="utf-8") as file:
        file.write(
            '<inkscape version="1" xmlns:sodipodi="http://sodipodi.sourceforge.net/DTD/sodipodi-0.dtd" '
            f'xmlns:inkscape="http://www.inkscape.org/namespaces/inkscape"><group id="extensions" {values}/></inkscape>'
        )


def kept(name):
    """Gives the drawing that was traced last another name; returns its path."""
    os.replace("traced.svg", name)
    return os.path.abspath(name)


def traced(path, ids, *more, **options):
    """Traces bitmaps of a drawing in Inkscape; returns the root of what it saves. ``more`` are actions after that."""
    made = os.path.abspath("traced.svg")
    if os.path.exists(made):
        os.remove(made)
    set_in_the_dialog(**{**QUICK, **options})
    actions = [f"select-by-id:{ids}", "smalti.trace.noprefs", *more, f"export-filename:{made}", "export-do"]
    command = ["inkscape", "--batch-process", path, "--actions=" + ";".join(actions)]
    # Inkscape waits forever for somebody who reads a message.
    subprocess.run(["timeout", "60", *command], capture_output=True, check=False)
    return etree.parse(made, etree.XMLParser(huge_tree=True)).getroot()


def pixels(path, *more):
    """A drawing as Inkscape draws it, RGBA, colours multiplied by alpha."""
    command = ["inkscape", path, "--export-type=png", "--export-filename=-", *more]
    png = subprocess.run(["timeout", "60", *command], capture_output=True, check=True).stdout
    size = subprocess.run(["identify", "-format", "%w %h", "-"], input=png, capture_output=True, check=True).stdout
    width, height = (int(number) for number in size.split())
    raw = subprocess.run(["convert", "-", "-depth", "8", "rgba:-"], input=png, capture_output=True, check=True).stdout
    rgba = numpy.frombuffer(raw, numpy.uint8).reshape(height, width, 4).astype(float)
    rgba[..., :3] *= rgba[..., 3:] / 255
    return rgba


def by_id(root, name):
    found = root.xpath(f"//*[@id='{name}']")
    return found[0] if found else None


def all_ids(root):
    return root.xpath("//@id")


def references(root):
    """The ids that something in a drawing refers to."""
    links = [value[1:] for value in root.xpath("//@xlink:href", namespaces={"xlink": LINK[1:-5]}) if value[:1] == "#"]
    return links + [value[5:-1] for value in root.xpath("//@clip-path | //@mask | //@filter") if value[:5] == "url(#"]


def told(element, prefix=""):
    """An element and all inside as text, without the ids that Inkscape gives, and with its spaces evened out."""
    attributes = []
    for name, value in sorted(element.attrib.items()):
        if prefix:
            value = value.replace(f"#{prefix}-", "#")
        if name != "id":
            attributes.append(f"{name}={value}")
    inside = "".join(told(child, prefix) for child in element.iterchildren(etree.Element))
    return f"<{element.tag} {' '.join(attributes)}>{inside}"
