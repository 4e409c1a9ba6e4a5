"""From a layer to its mosaic: what is evolved of it, and the layer that is laid above it.

It knows documents and nodes of Krita, and no dialog.
"""

import os

from krita import Krita

from . import smalti_program
from .colors import SRGB, converted, rgba, space_of
from .qt import QtCore, QtGui
from .smalti_program import Refused

#: What each kind of node without a picture of its own is called.
PICTURELESS = {
    "filterlayer": "a filter layer",
    "transparencymask": "a transparency mask",
    "filtermask": "a filter mask",
    "transformmask": "a transform mask",
    "selectionmask": "a selection mask",
    "colorizemask": "a colorize mask",
}
#: Masks that may show pixels where the layer itself has none.
REACHING_MASKS = {"filtermask", "transformmask"}


class Mosaic:
    """A layer of a document, and what becomes of it.

    Raises Refused if it cannot be evolved. ``name`` is that of the layer, ``width`` and ``height`` are those of the
    picture in px, ``selection`` is how much of each of its pixels is selected, 0 to 255, or None.
    """

    def __init__(self, document, nodes):
        if document is None:
            raise Refused("There is no picture. Open one first")
        self._document = document
        # What is still being painted belongs to the picture.
        document.waitForDone()
        self._node = _only_layer(nodes)
        self.name = self._node.name()
        rect, self.selection = self._rect()
        self._place = (rect.x(), rect.y(), rect.width(), rect.height())
        self.width, self.height = rect.width(), rect.height()

    def output_size(self, size):
        """The longer side at which a mosaic is drawn that evolves at ``size``; 0 if that is the size it has anyway."""
        longer = max(self.width, self.height)
        return longer if longer > size else 0

    def make(self, program, options, progress=None):
        """Evolves the layer and lays the mosaic directly above it; returns the new layer.

        All of it is one step of Krita's undo. Raises what ``smalti_program.evolve`` does, and changes nothing then.
        """
        made = smalti_program.evolve(program, self._picture(), options, progress=progress)
        return self._lay(self._pixels(made))

    def _rect(self):
        """Where in the document the picture is, and what of it is selected."""
        canvas = self._document.bounds()
        node = self._node
        # A fill layer reaches as far as the canvas, and so may what a mask makes of a layer.
        reaching = node.type() == "filllayer" or REACHING_MASKS & {child.type() for child in node.childNodes()}
        rect = canvas if reaching else node.bounds() & canvas
        if rect.isEmpty():
            raise Refused(f"The layer {self.name} has no pixels in the picture")
        chosen = self._document.selection()
        if chosen is None:
            return rect, None
        box = QtCore.QRect(chosen.x(), chosen.y(), chosen.width(), chosen.height())
        if box.isEmpty():
            raise Refused("The selection is empty")
        rect &= box
        selection = None if rect.isEmpty() else _bytes(chosen.pixelData, rect)
        if selection is None or _is_clear(selection):
            raise Refused(f"The selection does not touch the layer {self.name}")
        return rect, selection

    def _picture(self):
        """The picture as a PNG, clear where nothing is selected."""
        raw = self._node.projectionPixelData(*self._place).data()
        pixels = rgba(converted(raw, self.width, self.height, space_of(self._node), SRGB))
        if self.selection is not None:
            pixels[3::4] = _where(self.selection, pixels[3::4])
        if _is_clear(pixels[3::4]):
            what = "is selected of" if self.selection is not None else "can be seen of"
            raise Refused(f"Nothing {what} the layer {self.name}")
        return smalti_program.png(self.width, self.height, 4, pixels)

    def _pixels(self, made):
        """A mosaic in the colour space of the document."""
        image = QtGui.QImage.fromData(made)
        if image.isNull():
            raise Refused("Krita cannot read the mosaic that smalti has made: it may be too large")
        if (image.width(), image.height()) != (self.width, self.height):
            # The proportions of what has evolved are rounded to whole pixels.
            image = image.scaled(
                self.width,
                self.height,
                QtCore.Qt.AspectRatioMode.IgnoreAspectRatio,
                QtCore.Qt.TransformationMode.SmoothTransformation,
            )
        # This is BGRA in memory, as Krita has it, on all machines that Krita runs on.
        image = image.convertToFormat(QtGui.QImage.Format.Format_ARGB32)
        pixels = image.constBits().asstring(self.width * self.height * 4)
        return converted(pixels, self.width, self.height, SRGB, space_of(self._document))

    def _lay(self, pixels):
        """Lays pixels above the layer they are made of."""
        document = self._document
        layer = document.createNode(f"{self.name} (smalti)", "paintlayer")
        layer.setPixelData(pixels, *self._place)
        if self.selection is not None:
            mask = new_mask(document)
            mask.setPixelData(self.selection, *self._place)
            # Unlike addChildNode this is no step of its own to undo: the mask comes and goes with its layer.
            layer.setChildNodes([mask])
        self._node.parentNode().addChildNode(layer, self._node)
        # Krita makes it the active layer by itself.
        return layer


def _only_layer(nodes):
    """The one layer that is selected in a document."""
    if len(nodes) != 1:
        raise Refused("Several layers are selected. Select one" if nodes else "No layer is selected. Select one")
    node = nodes[0]
    if node.type() in PICTURELESS:
        raise Refused(f"{node.name()} is {PICTURELESS[node.type()]}, which has no pixels to evolve. Select a layer")
    if node.type() == "grouplayer" and node.passThroughMode():
        raise Refused(f"The group {node.name()} is passed through and has no pixels of its own. Select a layer in it")
    shown = node
    while shown:
        # Krita may not have drawn what nobody sees.
        if not shown.visible():
            raise Refused(f"The layer {node.name()} is hidden. Show it first")
        shown = shown.parentNode()
    return node


def new_mask(document):
    """A transparency mask that hides all, of no layer yet."""
    if hasattr(document, "createTransparencyMask"):
        return document.createTransparencyMask("Selection")
    # Before 5.2 Krita has no way to make a mask that has pixels, but one can be copied.
    krita = Krita.instance()
    usual = krita.batchmode()
    # Krita would show that it opens a document.
    krita.setBatchmode(True)
    source = krita.openDocument(os.path.join(os.path.dirname(os.path.abspath(__file__)), "mask.kra"))
    krita.setBatchmode(usual)
    if not source:
        raise Refused("The file mask.kra of this plug-in is missing. Install the plug-in anew")
    try:
        mask = source.topLevelNodes()[0].childNodes()[0].duplicate()
    finally:
        source.close()
    mask.setName("Selection")
    return mask


def _bytes(read, rect):
    return read(rect.x(), rect.y(), rect.width(), rect.height()).data()


def _is_clear(values):
    return values.count(0) == len(values)


def _where(selection, alpha):
    """Alpha, but 0 where nothing is selected. All at once, as whole numbers: a loop over the pixels takes minutes."""
    kept = selection.translate(b"\0" + b"\xff" * 255)
    kept = int.from_bytes(kept, "little") & int.from_bytes(alpha, "little")
    return kept.to_bytes(len(alpha), "little")
