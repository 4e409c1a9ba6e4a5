"""The dialog: what a person chooses for a mosaic, and how far its making has come.

It remembers the choices in Krita's settings. It knows no pixels; a Mosaic does the work.
"""

from krita import Krita

from . import smalti_program
from .qt import QtCore, QtGui, QtWidgets
from .smalti_program import Cancelled, Options, Refused

TITLE = "Mosaic of Tiles"
#: Our group of Krita's settings.
SETTINGS = "smalti"
#: The options that are remembered, by their names in Options.
REMEMBERED = ("style", "tiles", "mask", "grout", "grout_color", "evals", "size", "seed")
#: Steps of the progress bar.
BAR_STEPS = 1000


class MosaicDialog(QtWidgets.QDialog):
    """Asks for the options and has the mosaic made; ends when it is laid, or when the person gives up."""

    def __init__(self, mosaic, parent=None):
        super().__init__(parent)
        self._mosaic = mosaic
        self._working = False
        self._cancelled = False
        self.setWindowTitle(TITLE)
        self._build()
        self.show_options(_remembered_options())
        self.program.setText(Krita.instance().readSetting(SETTINGS, "program", ""))
        try:
            smalti_program.find(self.program.text())
        except Refused as error:
            self._ask_for_program(error)

    def accept(self):
        """Makes the mosaic; the dialog stays if there is none."""
        if self._working:
            return
        told = self.program.text().strip()
        try:
            program = smalti_program.find(told)
        except Refused as error:
            self._ask_for_program(error)
            return
        Krita.instance().writeSetting(SETTINGS, "program", told)
        options = self.options()
        _remember(options)
        self._set_working(True)
        try:
            self._mosaic.make(program, options, self._progress)
        except Cancelled:
            self.tell("Cancelled")
        except Refused as error:
            self.tell(error, is_problem=True)
        else:
            super().accept()
        finally:
            self._set_working(False)

    def reject(self):
        """Ends the work, or if there is none the dialog. Escape and the window's own button end up here, too."""
        if self._working:
            self._cancelled = True
        else:
            super().reject()

    def options(self):
        """What is chosen."""
        size = self.size_px.value()
        return Options(
            style=self.style_choice.currentData(),
            tiles=self.tiles.value(),
            seed=self.seed.value(),
            mask=self.mask.currentData(),
            grout=self.grout.currentData(),
            grout_color=self.grout_color.name(),
            evals=self.evals.value(),
            size=size,
            output_size=self._mosaic.output_size(size),
        )

    def show_options(self, options):
        """Shows a choice."""
        for field in (self.style_choice, self.mask, self.grout):
            field.setCurrentIndex(max(0, field.findData(getattr(options, field.objectName()))))
        for field in (self.tiles, self.evals, self.size_px, self.seed):
            field.setValue(getattr(options, field.objectName()))
        self.grout_color.set_name(options.grout_color)

    def tell(self, sentence, is_problem=False):
        """Shows a sentence above the buttons."""
        self.message.setText(with_full_stop(sentence))
        self.sign.setVisible(is_problem)
        self.notice.show()

    def _progress(self, share):
        self.bar.setFormat("Cancelling" if self._cancelled else "Drawing" if share >= 1 else "Evolving: %p %")
        self.bar.setValue(round(share * BAR_STEPS))
        QtWidgets.QApplication.processEvents()
        return not self._cancelled

    def _set_working(self, working):
        self._working = working
        self._cancelled = False
        for part in (self.controls, self.evolve_button, self.defaults_button):
            part.setEnabled(not working)
        self.bar.reset()
        self.bar.setFormat("Reading the layer")
        self.bar.setVisible(working)
        if working:
            self.notice.hide()
            QtWidgets.QApplication.processEvents()

    def _ask_for_program(self, error):
        self._show_program_row(True)
        self.tell(error, is_problem=True)

    def _show_program_row(self, shown):
        for part in self.program_row:
            part.setVisible(shown)

    def _browse(self):
        path, _ = QtWidgets.QFileDialog.getOpenFileName(self, "The program smalti", self.program.text())
        if path:
            self.program.setText(path)

    def _show_grout_color(self):
        self.grout_color.setVisible(self.grout.currentData() == "color")

    def _build(self):
        layout = QtWidgets.QVBoxLayout(self)
        layout.setSpacing(12)
        source = QtWidgets.QLabel(_described(self._mosaic))
        source.setTextFormat(QtCore.Qt.TextFormat.PlainText)
        source.setWordWrap(True)
        for part in (source, self._build_controls(), self._build_notice()):
            layout.addWidget(part)
        layout.addStretch()
        self.bar = QtWidgets.QProgressBar()
        self.bar.setRange(0, BAR_STEPS)
        # Buttons must not move away from under the pointer when the work begins.
        policy = self.bar.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.bar.setSizePolicy(policy)
        self.bar.hide()
        layout.addWidget(self.bar)
        layout.addWidget(self._build_buttons())
        self.setMinimumWidth(440)
        self.style_choice.setFocus()

    def _build_controls(self):
        self.style_choice = _choice("style", smalti_program.STYLES, "What the mosaic looks like")
        self.tiles = _number("tiles", 0, 1_000_000, 100, "How many tiles there are")
        self.mask = _choice("mask", smalti_program.MASKS, "The shape of each tile")
        self.grout = _choice("grout", smalti_program.GROUTS, "The ring around each tile")
        self.grout_color = ColorButton()
        self.evals = _number("evals", 0, 2_000_000_000, 50_000, "How many changes are tried; more take longer")
        self.size_px = _number("size", 16, 8192, 64, "The longer side at which it evolves; it is drawn in full size")
        self.seed = _number("seed", 0, 2_147_483_647, 1, "Each number makes another mosaic, and always the same one")
        for field in (self.tiles, self.evals):
            field.setSpecialValueText("Automatic")
        self.evals.setSuffix(" tries")
        self.size_px.setSuffix(" px")
        self.grout.currentIndexChanged.connect(self._show_grout_color)
        self._show_grout_color()
        grout = _side_by_side(self.grout, self.grout_color)
        self.controls = QtWidgets.QWidget()
        form = QtWidgets.QFormLayout(self.controls)
        form.setContentsMargins(0, 0, 0, 0)
        form.setFieldGrowthPolicy(QtWidgets.QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        form.addRow("&Style:", self.style_choice)
        form.addRow("&Tiles:", self.tiles)
        form.addRow("Tile s&hape:", self.mask)
        form.addRow("&Grout:", grout)
        form.addRow("&Effort:", self.evals)
        form.addRow("Evolve &at:", self.size_px)
        form.addRow("See&d:", self.seed)
        self.program = QtWidgets.QLineEdit()
        self.program.setPlaceholderText("Where the program smalti is")
        browse = QtWidgets.QPushButton("&Browse...")
        browse.setAutoDefault(False)
        browse.clicked.connect(self._browse)
        program = _side_by_side(self.program, browse)
        form.addRow("&Program:", program)
        self.program_row = (form.labelForField(program), program)
        self._show_program_row(False)
        return self.controls

    def _build_notice(self):
        """A sentence that can be read and copied, with a sign before it if it tells of a problem."""
        self.sign = QtWidgets.QLabel()
        icon = self.style().standardIcon(QtWidgets.QStyle.StandardPixmap.SP_MessageBoxWarning)
        self.sign.setPixmap(icon.pixmap(24, 24))
        self.message = QtWidgets.QLabel()
        self.message.setWordWrap(True)
        self.message.setTextFormat(QtCore.Qt.TextFormat.PlainText)
        self.message.setTextInteractionFlags(QtCore.Qt.TextInteractionFlag.TextSelectableByMouse)
        self.notice = QtWidgets.QWidget()
        row = QtWidgets.QHBoxLayout(self.notice)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.sign, 0, QtCore.Qt.AlignmentFlag.AlignTop)
        row.addWidget(self.message, 1)
        self.notice.hide()
        return self.notice

    def _build_buttons(self):
        box = QtWidgets.QDialogButtonBox
        buttons = box(box.StandardButton.Ok | box.StandardButton.Cancel | box.StandardButton.RestoreDefaults)
        self.evolve_button = buttons.button(box.StandardButton.Ok)
        self.evolve_button.setText("E&volve")
        self.evolve_button.setDefault(True)
        self.cancel_button = buttons.button(box.StandardButton.Cancel)
        self.defaults_button = buttons.button(box.StandardButton.RestoreDefaults)
        self.defaults_button.clicked.connect(lambda: self.show_options(Options()))
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        return buttons


class ColorButton(QtWidgets.QPushButton):
    """A button that shows a colour, and lets a person choose another one."""

    def __init__(self):
        super().__init__()
        self.setAutoDefault(False)
        self.setToolTip("The colour of the grout")
        self.clicked.connect(self._ask)

    def name(self):
        """The colour as ``#rrggbb``."""
        return self._color.name()

    def set_name(self, name):
        """Takes a colour as ``#rrggbb``."""
        self._color = QtGui.QColor(name)
        swatch = QtGui.QPixmap(self.iconSize())
        swatch.fill(self._color)
        self.setIcon(QtGui.QIcon(swatch))
        self.setText(self.name())

    def _ask(self):
        color = QtWidgets.QColorDialog.getColor(self._color, self, "Colour of the Grout")
        if color.isValid():
            self.set_name(color.name())


def with_full_stop(sentence):
    """A sentence of the program, which has no full stop, as people read it."""
    return str(sentence).rstrip(".") + "."


def _described(mosaic):
    size = f"{mosaic.width} x {mosaic.height} px"
    if mosaic.selection is None:
        return f"Layer {mosaic.name}, {size}"
    return f"Selected part of the layer {mosaic.name}, {size}. The selection becomes the mask of the new layer."


def _side_by_side(field, button):
    """A field with a button that belongs to it."""
    both = QtWidgets.QWidget()
    row = QtWidgets.QHBoxLayout(both)
    row.setContentsMargins(0, 0, 0, 0)
    row.addWidget(field, 1)
    row.addWidget(button)
    both.setFocusProxy(field)
    return both


def _choice(name, entries, tip):
    """A list to choose from; ``name`` is that of the option."""
    field = QtWidgets.QComboBox()
    field.setObjectName(name)
    field.setToolTip(tip)
    for value, text in entries:
        field.addItem(text, value)
    return field


def _number(name, least, most, step, tip):
    field = QtWidgets.QSpinBox()
    field.setObjectName(name)
    field.setToolTip(tip)
    field.setRange(least, most)
    field.setSingleStep(step)
    field.setGroupSeparatorShown(True)
    return field


def _remembered_options():
    """The options of the last time."""
    options = Options()
    for name in REMEMBERED:
        usual = getattr(options, name)
        told = Krita.instance().readSetting(SETTINGS, name, str(usual))
        try:
            setattr(options, name, type(usual)(told))
        except ValueError:
            # Someone has written something else into the settings.
            pass
    return options


def _remember(options):
    for name in REMEMBERED:
        Krita.instance().writeSetting(SETTINGS, name, str(getattr(options, name)))
