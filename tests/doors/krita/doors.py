"""What the checks of the plug-in for Krita share: documents to try it on, and what the program makes of pixels."""

import os
import subprocess
import sys

from krita import Krita, Selection
from smalti.qt import QtGui

PROGRAM = os.environ["SMALTI"]
SCRATCH = os.environ["SCRATCH"]
SRGB = ("RGBA", "U8", "sRGB-elle-V2-srgbtrc.icc")
#: Small enough to take a fraction of a second.
FEW = {"tiles": 60, "evals": 2000, "seed": 5}

_failures = []


def check(holds, what):
    """Prints one line, and remembers if it is a failure."""
    print("ok -" if holds else "NOT OK -", what, flush=True)
    if not holds:
        _failures.append(what)


def same(one, other, what):
    """Checks that two things are equal, and shows them otherwise."""
    check(one == other, what)
    if one != other:
        print(f"   {_short(one)}\n   {_short(other)}", flush=True)


def end():
    """Leaves the verdict where ``run`` looks for it: the hosts do not hand an exit code on."""
    with open(os.path.join(SCRATCH, "verdict"), "w", encoding="utf-8") as verdict:
        verdict.write(f"{len(_failures)} failures\n")
    sys.stdout.flush()


def new_document(width, height, space=SRGB):
    """A document with a transparent layer named Ground."""
    document = Krita.instance().createDocument(width, height, "check", *space, 72.0)
    ground = document.topLevelNodes()[0]
    ground.setName("Ground")
    clear(ground, width, height)
    return document


def clear(node, width, height):
    """Takes all pixels off a layer."""
    size = len(node.pixelData(0, 0, 1, 1))
    node.setPixelData(bytes(size * width * height), 0, 0, width, height)


def photo(width, height):
    """A photo of parrots, as BGRA of that size."""
    image = QtGui.QImage(os.environ["PHOTO"]).scaled(width, height).convertToFormat(QtGui.QImage.Format.Format_ARGB32)
    return image.constBits().asstring(width * height * 4)


def painted(width, height, x=0, y=0, canvas=None):
    """A document with the photo on its layer at a place; and that layer."""
    document = new_document(*(canvas or (width, height)))
    layer = document.topLevelNodes()[0]
    layer.setPixelData(photo(width, height), x, y, width, height)
    document.refreshProjection()
    document.waitForDone()
    return document, layer


def select(document, x, y, width, height, value=255):
    """Selects a rectangle of a document."""
    selection = Selection()
    selection.select(x, y, width, height, value)
    document.setSelection(selection)
    document.waitForDone()
    return selection


def pixels(node, x, y, width, height):
    """Pixels of a layer as bytes."""
    return node.pixelData(x, y, width, height).data()


def program_made(bgra, width, height, *flags):
    """What the program makes of pixels, given and taken as files, read and written by others than the plug-in."""
    source, made = (os.path.join(SCRATCH, name) for name in ("given.png", "made.png"))
    QtGui.QImage(bgra, width, height, width * 4, QtGui.QImage.Format.Format_ARGB32).save(source)
    usual = ["--style", "mosaic", "--size", "512", "--tiles", "60", "--evals", "2000", "--seed", "5"]
    command = [PROGRAM, "evolve", source, "-o", made, "--force", "-q", *(flags or usual)]
    subprocess.run(command, check=True)
    document = Krita.instance().openDocument(made)
    size = document.width(), document.height()
    result = pixels(document.topLevelNodes()[0], 0, 0, *size)
    document.close()
    return result if size == (width, height) else f"a picture of {size} px"


def script(name, text):
    """A program that is none of ours."""
    path = os.path.join(SCRATCH, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write("#!/bin/sh\n" + text)
    os.chmod(path, 0o755)
    return path


def children():
    """The processes that this one has started and that still run."""
    with open(f"/proc/self/task/{os.getpid()}/children", encoding="ascii") as file:
        return file.read().split()


def _short(value):
    told = repr(value)
    return told if len(told) < 200 else f"{told[:90]} ... {told[-90:]} ({len(value)})"
