"""Runs in Krita's own window: uses the menu and the dialog as a person would.

A plug-in itself. A timer walks through ``steps``, also while the dialog has the word, and goes on when what a step
waits for has come.
"""

import os
import subprocess
import time
import traceback

from doors import PROGRAM, check, children, end, painted, photo, pixels, program_made, same, script, select
from krita import Extension, Krita
from smalti.dialog import MosaicDialog
from smalti.qt import QtCore, QtGui, QtWidgets

PATIENCE_S = 40


def modal():
    return QtWidgets.QApplication.activeModalWidget()


def dialog():
    """The plug-in's dialog, if it is there."""
    return modal() if isinstance(modal(), MosaicDialog) else None


def later(act):
    """Does what may not return before a dialog is closed."""
    QtCore.QTimer.singleShot(0, act)


def photograph(name):
    """Takes a picture of the screen, if someone wants one."""
    if "SHOTS" in os.environ:
        QtWidgets.QApplication.processEvents()
        time.sleep(0.5)
        subprocess.run(["import", "-window", "root", f"{os.environ['SHOTS']}/krita-{name}.png"], check=True)


def press_escape(widget):
    key, none = QtCore.Qt.Key.Key_Escape, QtCore.Qt.KeyboardModifier.NoModifier
    pressed = QtGui.QKeyEvent(QtCore.QEvent.Type.KeyPress, key, none)
    QtWidgets.QApplication.sendEvent(widget, pressed)


def choose(field, value):
    field.setCurrentIndex(field.findData(value))


def set_options(shown, evals=2000):
    shown.tiles.setValue(60)
    shown.evals.setValue(evals)
    shown.seed.setValue(5)


def undo(document, name="edit_undo"):
    Krita.instance().action(name).trigger()
    document.waitForDone()


class Scene:
    """A picture in a window, and the plug-in's entry in the menu."""

    def __init__(self, width=128, height=96):
        krita = Krita.instance()
        self.window = krita.activeWindow()
        self.document, self.layer = painted(width, height)
        self.window.addView(self.document)
        krita.setActiveDocument(self.document)
        self.document.setActiveNode(self.layer)
        self.entry = krita.action("smalti")

    def layers(self):
        # Krita keeps the selection among the layers.
        return [node.name() for node in self.document.topLevelNodes() if node.type() != "selectionmask"]

    def close(self):
        self.document.setModified(False)
        self.document.close()


def steps():
    yield lambda: Krita.instance().activeWindow()
    yield from in_the_menu()
    yield from makes_one_undoable_step()
    yield from remembers()
    yield from cancels()
    yield from tells_what_is_wrong()
    yield from asks_for_the_program()


def in_the_menu():
    bar = Krita.instance().activeWindow().qwindow().menuBar()
    menus = {entry.objectName().lower(): entry.menu() for entry in bar.actions()}
    texts = [entry.text().replace("&", "") for entry in menus["filter"].actions()]
    check("Mosaic of Tiles (smalti)..." in texts, "the Filter menu has the entry")
    check(not Krita.instance().action("smalti").isEnabled(), "it rests while there is no picture")
    yield lambda: True


def makes_one_undoable_step():
    scene = Scene()
    select(scene.document, 10, 10, 80, 70)
    yield lambda: Krita.instance().activeDocument() == scene.document and scene.entry.isEnabled()
    before = Krita.instance().action("edit_undo").isEnabled()
    later(scene.entry.trigger)
    yield dialog
    shown = dialog()
    check(not shown.program.isVisible(), "a program that is found is not asked for")
    check(not shown.grout_color.isVisible(), "the colour of the grout is shown only if one is chosen")
    set_options(shown)
    photograph("dialog-selection")
    later(shown.evolve_button.click)
    yield lambda: not modal()
    photograph("result-selection")
    same(scene.layers(), ["Ground", "Ground (smalti)"], "Evolve lays the mosaic and ends the dialog")
    made = scene.document.topLevelNodes()[1]
    same(scene.document.activeNode().name(), made.name(), "the mosaic is the active layer")
    cut = pixels(scene.layer, 10, 10, 80, 70)
    expected = program_made(cut, 80, 70)
    same(pixels(made, 10, 10, 80, 70), expected, "it has the program's own pixels")
    undo(scene.document)
    same(scene.layers(), ["Ground"], "one undo takes the mosaic and its mask away")
    same(Krita.instance().action("edit_undo").isEnabled(), before, "and there is no second step to undo")
    check(scene.document.selection() is not None, "the selection is still there")
    undo(scene.document, "edit_redo")
    again = scene.document.topLevelNodes()[1]
    same(pixels(again, 10, 10, 80, 70), expected, "redo brings the mosaic back")
    same([mask.type() for mask in again.childNodes()], ["transparencymask"], "with its mask")
    scene.close()


def remembers():
    scene = Scene()
    yield lambda: Krita.instance().activeDocument() == scene.document
    later(scene.entry.trigger)
    yield dialog
    shown = dialog()
    same((shown.tiles.value(), shown.seed.value()), (60, 5), "the dialog remembers the options")
    choose(shown.grout, "color")
    shown.grout_color.set_name("#102030")
    choose(shown.mask, "hexagon")
    same(shown.options().arguments(),
         ["--style", "mosaic", "--seed", "5", "--size", "512", "--tiles", "60", "--mask", "hexagon",
          "--grout", "#102030", "--evals", "2000"], "and says them in flags of the program")  # fmt: skip
    photograph("dialog-grout")
    shown.defaults_button.click()
    same(shown.options().arguments(), ["--style", "mosaic", "--seed", "0", "--size", "512"], "defaults can be restored")
    photograph("dialog")
    shown.cancel_button.click()
    yield lambda: not modal()
    same(scene.layers(), ["Ground"], "Cancel leaves the picture as it was")
    scene.close()


def cancels():
    # Larger than a pipe holds, so that the program may be ended while it is still being told.
    scene = Scene(640, 480)
    yield lambda: Krita.instance().activeDocument() == scene.document
    before = Krita.instance().action("edit_undo").isEnabled()
    for how, stop in (
        ("button", lambda shown: shown.cancel_button.click()),
        ("Escape", press_escape),
        ("the window's own button", lambda shown: shown.close()),
    ):
        later(scene.entry.trigger)
        yield dialog
        shown = dialog()
        set_options(shown, evals=500_000_000)
        ticks = []
        timer = QtCore.QTimer()
        timer.timeout.connect(lambda: ticks.append(time.monotonic()))
        timer.start(50)
        later(shown.evolve_button.click)
        yield lambda: len(ticks) > 20 and shown.bar.isVisible()
        check(not shown.evolve_button.isEnabled() and not shown.controls.isEnabled(), "options rest while it works")
        check(max(b - a for a, b in zip(ticks[5:], ticks[6:])) < 1.0, "the window answers while it works")
        photograph("dialog-working")
        stop(shown)
        yield lambda: not shown.bar.isVisible()
        timer.stop()
        same(shown.message.text(), "Cancelled.", f"work is cancelled by {how}, and the dialog says so")
        same(children(), [], "the program is gone")
        same(scene.layers(), ["Ground"], "nothing is laid")
        same(Krita.instance().action("edit_undo").isEnabled(), before, "there is nothing to undo")
        check(shown.evolve_button.isEnabled(), "and another try is possible")
        later(shown.reject)
        yield lambda: not modal()
    scene.close()


def tells_what_is_wrong():
    scene = Scene()
    yield lambda: Krita.instance().activeDocument() == scene.document
    select(scene.document, 500, 500, 20, 20)
    later(scene.entry.trigger)
    yield lambda: isinstance(modal(), QtWidgets.QMessageBox)
    same(modal().text(), "The selection does not touch the layer Ground.", "what is wrong is told before the dialog")
    photograph("refused")
    later(modal().accept)
    yield lambda: not modal()
    scene.close()


def asks_for_the_program():
    scene = Scene()
    yield lambda: Krita.instance().activeDocument() == scene.document
    usual = os.environ.pop("SMALTI"), os.environ["PATH"]
    os.environ["PATH"] = "/nowhere"
    later(scene.entry.trigger)
    yield dialog
    shown = dialog()
    check(shown.program.isVisible(), "a program that is not found is asked for")
    check(shown.message.text().startswith("The program smalti was not found."), "with the reason")
    os.environ["PATH"] = usual[1]
    photograph("program")
    shown.evolve_button.click()
    check(shown.isVisible() and scene.layers() == ["Ground"], "Evolve without a program leaves the dialog")
    failing = "[ $1 = --version ] && exec echo smalti 9.9.9\necho 'smalti: the moon is in the way' >&2\nexit 1\n"
    shown.program.setText(script("failing", failing))
    set_options(shown)
    later(shown.evolve_button.click)
    yield lambda: "moon" in shown.message.text()
    same(shown.message.text(), "the moon is in the way.", "the program's own sentence is shown")
    photograph("failed")
    shown.program.setText(usual[0])
    later(shown.evolve_button.click)
    yield lambda: not modal()
    expected = program_made(photo(128, 96), 128, 96)
    same(pixels(scene.document.topLevelNodes()[1], 0, 0, 128, 96), expected, "the program that is named there works")
    same(Krita.instance().readSetting("smalti", "program", ""), PROGRAM, "and is remembered")
    os.environ["SMALTI"] = usual[0]
    scene.close()


class Walker(QtCore.QObject):
    """Walks through the steps."""

    def __init__(self):
        super().__init__()
        self._steps = steps()
        self._come = lambda: True
        self._until = time.monotonic() + PATIENCE_S
        self._timer = QtCore.QTimer(self)
        self._timer.timeout.connect(self._walk)
        self._timer.start(50)

    def _walk(self):
        try:
            if self._come():
                self._come = next(self._steps)
                self._until = time.monotonic() + PATIENCE_S
            elif time.monotonic() > self._until:
                photograph("stuck")
                raise TimeoutError("what was waited for has not come")
        except StopIteration:
            self._leave()
        except Exception:
            traceback.print_exc()
            check(False, "the checks in the window ran to their end")
            self._leave()

    def _leave(self):
        end()
        # Krita would ask what to do with pictures that are not saved.
        os._exit(0)


class WindowChecks(Extension):
    """Begins when Krita has come up."""

    def setup(self):
        pass

    def createActions(self, window):
        self._walker = Walker()


Krita.instance().addExtension(WindowChecks(Krita.instance()))
