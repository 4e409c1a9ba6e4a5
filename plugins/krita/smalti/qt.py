"""Qt, from the PyQt that this Krita was built with: PyQt5 for Krita 5, PyQt6 for Krita 6."""

import sys

import krita  # noqa: F401 -- it loads one PyQt, and loading the other one beside it would crash.

if "PyQt6.QtCore" in sys.modules:
    from PyQt6 import QtCore, QtGui, QtWidgets

    # Otherwise Qt 6 refuses to read pictures of more than 256 MiB.
    QtGui.QImageReader.setAllocationLimit(0)
else:
    from PyQt5 import QtCore, QtGui, QtWidgets

__all__ = ["QtCore", "QtGui", "QtWidgets"]
