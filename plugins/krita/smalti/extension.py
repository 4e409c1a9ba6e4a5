"""The entry in Krita's Filter menu."""

from krita import Extension, Krita

from .dialog import TITLE, MosaicDialog, with_full_stop
from .mosaic import Mosaic
from .qt import QtWidgets
from .smalti_program import Refused


class SmaltiExtension(Extension):
    """Puts the entry into the menu of each window, and shows the dialog when it is chosen."""

    def setup(self):
        """Krita calls this once; there is nothing to do before there is a window."""

    def createActions(self, window):
        """Krita calls this for each window."""
        action = window.createAction("smalti", "Mosaic of Tiles (smalti)...", "filter")
        action.triggered.connect(self._ask)

    def _ask(self):
        window = Krita.instance().activeWindow()
        document = Krita.instance().activeDocument()
        try:
            mosaic = Mosaic(document, window.activeView().selectedNodes() if document else [])
        except Refused as error:
            QtWidgets.QMessageBox.warning(window.qwindow(), TITLE, with_full_stop(error))
            return
        dialog = MosaicDialog(mosaic, window.qwindow())
        try:
            dialog.exec()
        finally:
            dialog.deleteLater()
