#!/usr/bin/env python3
"""Filters > Artistic > smalti in GIMP 3: lays a layer, or the selected part of it, anew in evolved tiles.

GIMP converts: pixels are taken and given as 8-bit sRGB, whatever the image has. The program smalti evolves; how it is
found and run is told in smalti_program.py, which lies beside this file.
"""

import os
import random
import sys

import gi

gi.require_version("Babl", "0.1")
gi.require_version("GdkPixbuf", "2.0")
gi.require_version("Gegl", "0.4")
gi.require_version("Gimp", "3.0")
from gi.repository import Babl, GdkPixbuf, Gegl, Gimp, Gio, GLib, GObject

import smalti_program
from smalti_program import Refused

PROCEDURE = "plug-in-smalti"

#: What pixels are on their way to the program and back.
RGBA = "R'G'B'A u8"

#: Pixels of less alpha get no tiles.
CLEAR_BELOW = 128

GROUT_COLOR = smalti_program.Options().grout_color

#: As much as GIMP's arguments can hold.
SEED_MAX = 2**31 - 1

#: What stands behind the entries of numbers in the dialog.
HINTS = {
    "tiles": "0: automatic",
    "size": "px",
    "evals": "changes, 0: automatic",
    "scale": "1: as large as the layer",
}


class Part:
    """The part of a layer that is laid anew: its place on the layer, in px, and the selection that bounds it, if any.

    The selection is kept, since a person may go on to select something else while the mosaic evolves.
    """

    def __init__(self, image, layer):
        is_met, self.x, self.y, self.width, self.height = layer.mask_intersect()
        if not is_met:
            raise Refused("The selection does not meet the layer; select a part of it, or nothing to take all of it")
        self.image = image
        self.layer = layer
        self.area = Gegl.Rectangle.new(0, 0, self.width, self.height)
        self.selection = None
        if not Gimp.Selection.is_empty(image):
            self.selection = self.cut(image.get_selection(), *self.offsets())

    def offsets(self):
        """Where it lies in the image now."""
        _, left, top = self.layer.get_offsets()
        return left + self.x, top + self.y

    def cut(self, channel, x, y):
        """A copy of what a channel has there."""
        there = Gegl.Rectangle.new(x, y, self.width, self.height)
        buffer = Gegl.Buffer.new("Y float", 0, 0, self.width, self.height)
        channel.get_buffer().copy(there, Gegl.AbyssPolicy.NONE, buffer, self.area)
        return buffer

    def picture(self, source):
        """The pixels of ``source``, which are the layer's with or without its effects, as a PNG.

        What is not selected is clear, so that no tile is spent on it.
        """
        there = Gegl.Rectangle.new(self.x, self.y, self.width, self.height)
        pixels = bytearray(read(source.get_buffer(), there, RGBA))
        if self.selection:
            selected = read(self.selection, self.area, "Y u8").translate(bytes(1) + b"\xff" * 255)
            # Two numbers of as many bytes are by far the fastest way to combine two channels without numpy.
            alpha = int.from_bytes(pixels[3::4], "big") & int.from_bytes(selected, "big")
            pixels[3::4] = alpha.to_bytes(len(selected), "big")
        if max(pixels[3::4]) < CLEAR_BELOW:
            raise Refused("The layer is clear there: nothing is to be seen that could be laid in tiles")
        return smalti_program.png(self.width, self.height, 4, pixels)


def read(buffer, area, pixel_format):
    return buffer.get(area, 1.0, pixel_format, Gegl.AbyssPolicy.NONE)


def write(buffer, x, y, pixbuf):
    """Puts an RGBA picture into a buffer, which converts it to what its drawable is made of."""
    area = Gegl.Rectangle.new(x, y, pixbuf.get_width(), pixbuf.get_height())
    buffer.set(area, RGBA, pixbuf.read_pixel_bytes().get_data())
    buffer.flush()


def mask(layer, *buffers):
    """Masks a layer by buffers of its size; what is to be seen must be so in all of them."""
    layer_mask = layer.create_mask(Gimp.AddMaskType.WHITE)
    graph = Gegl.Node()
    last = None
    for buffer in buffers:
        source = graph.create_child("gegl:buffer-source")
        source.set_property("buffer", buffer)
        if last:
            product = graph.create_child("gegl:multiply")
            last.link(product)
            source.connect_to("output", product, "aux")
        last = product if last else source
    target = graph.create_child("gegl:write-buffer")
    target.set_property("buffer", layer_mask.get_buffer())
    last.link(target)
    target.process()
    layer_mask.get_buffer().flush()
    layer.add_mask(layer_mask)
    # GIMP would paint on the mask from now on, and call the next filter for it.
    layer.set_edit_mask(False)
    # Its thumbnail would stay white.
    layer_mask.update(0, 0, layer.get_width(), layer.get_height())


def only_layer(image, drawables):
    """The layer to take, or why it cannot be taken."""
    if len(drawables) != 1:
        raise Refused("smalti takes one layer at a time; choose one")
    layer = drawables[0]
    if isinstance(layer, Gimp.LayerMask):
        raise Refused("The layer's mask is chosen; choose the layer itself")
    if not isinstance(layer, Gimp.Layer):
        raise Refused("A channel has no colours; choose a layer")
    if isinstance(layer, Gimp.GroupLayer):
        raise Refused("A layer group has no pixels of its own; choose a layer in it, or merge the group")
    if image.get_floating_sel():
        raise Refused("There is a floating selection; anchor it or make it a layer, and try again")
    return layer


def in_hex(color):
    """A colour as the program reads it."""
    *channels, alpha = color.get_bytes(Babl.format(RGBA)).get_data()
    # GIMP 3.0.4 sends a clear one for a script that names none, whatever the default is.
    return "#" + bytes(channels).hex() if alpha else GROUT_COLOR


def evolved(program, part, config, progress):
    """The mosaic of a part as an RGBA picture, and of the size that the settings ask for."""
    ask = config.get_property
    longer_side = max(part.width, part.height)
    scale = ask("scale")
    # Without a size the program writes what it has evolved, pixel by pixel.
    output_size = round(longer_side * scale) if scale != 1 or longer_side > ask("size") else 0
    options = smalti_program.Options(
        style=ask("style"),
        tiles=ask("tiles"),
        seed=ask("seed"),
        mask=ask("mask"),
        grout=ask("grout"),
        grout_color=in_hex(ask("grout-color")),
        evals=ask("evals"),
        size=ask("size"),
        output_size=output_size,
    )
    if ask("new-layer") and part.layer.get_filters():
        # The mosaic is of what is seen. It is laid above, where the layer's effects do not reach it.
        merged = part.layer.copy()
        merged.merge_filters()
        picture = part.picture(merged)
        merged.delete()
    else:
        picture = part.picture(part.layer)
    made = smalti_program.evolve(program, picture, options, progress=progress)
    try:
        stream = Gio.MemoryInputStream.new_from_bytes(GLib.Bytes.new(made))
        mosaic = GdkPixbuf.Pixbuf.new_from_stream(stream, None).add_alpha(False, 0, 0, 0)
    except GLib.Error as error:
        raise Refused(f"What smalti has written is no picture: {error.message}") from error
    if scale == 1 and (mosaic.get_width(), mosaic.get_height()) != (part.width, part.height):
        # The picture was reduced to evolve, and its shorter side rounded.
        mosaic = mosaic.scale_simple(part.width, part.height, GdkPixbuf.InterpType.BILINEAR)
    return mosaic


def empty_layer(image, name, width, height):
    kinds = {
        Gimp.ImageBaseType.RGB: Gimp.ImageType.RGBA_IMAGE,
        Gimp.ImageBaseType.GRAY: Gimp.ImageType.GRAYA_IMAGE,
        Gimp.ImageBaseType.INDEXED: Gimp.ImageType.INDEXEDA_IMAGE,
    }
    kind = kinds[image.get_base_type()]
    return Gimp.Layer.new(image, name, width, height, kind, 100, image.get_default_new_layer_mode())


def lay_above(part, mosaic):
    """The mosaic as a new layer right above the one that it was made of."""
    image, layer = part.image, part.layer
    new = empty_layer(image, f"{layer.get_name()} in tiles", part.width, part.height)
    write(new.get_buffer(), 0, 0, mosaic)
    masks = [part.selection] if part.selection else []
    if layer.get_mask() and layer.get_apply_mask():
        # What is hidden of the source would come to light above it.
        masks.append(part.cut(layer.get_mask(), part.x, part.y))
    image.undo_group_start()
    image.insert_layer(new, layer.get_parent(), image.get_item_position(layer))
    new.set_offsets(*part.offsets())
    if masks:
        mask(new, *masks)
    image.undo_group_end()
    return new


def over_pixels(part, mosaic):
    """The mosaic over the layer's own pixels, which a layer without transparency keeps where the mosaic is clear."""
    width, height = part.width, part.height
    own = read(part.layer.get_buffer(), Gegl.Rectangle.new(part.x, part.y, width, height), RGBA)
    colors = GdkPixbuf.Colorspace.RGB
    whole = GdkPixbuf.Pixbuf.new_from_bytes(GLib.Bytes.new(own), colors, True, 8, width, height, 4 * width).copy()
    mosaic.composite(whole, 0, 0, width, height, 0, 0, 1, 1, GdkPixbuf.InterpType.NEAREST, 255)
    return whole


def lay_over(part, mosaic):
    """The mosaic instead of the layer's pixels, as far as they are selected; that is one step of undo by itself."""
    layer = part.layer
    if not layer.has_alpha():
        mosaic = over_pixels(part, mosaic)
    write(layer.get_shadow_buffer(), part.x, part.y, mosaic)
    layer.merge_shadow(True)
    layer.update(part.x, part.y, part.width, part.height)
    return layer


def lay_apart(part, mosaic):
    """The mosaic as a new image: of the same kind, as large on paper, of more or fewer pixels."""
    image, width, height = part.image, mosaic.get_width(), mosaic.get_height()
    # A palette of few colours would not do the tiles justice, and it could be of other colours for another size.
    kind = image.get_base_type() if image.get_base_type() != Gimp.ImageBaseType.INDEXED else Gimp.ImageBaseType.RGB
    new_image = Gimp.Image.new_with_precision(part.width, part.height, kind, image.get_precision())
    new_image.undo_disable()
    if image.get_color_profile():
        new_image.set_color_profile(image.get_color_profile())
    new = empty_layer(new_image, f"{part.layer.get_name()} in tiles", part.width, part.height)
    new_image.insert_layer(new, None, 0)
    if part.selection:
        mask(new, part.selection)
    # The mask grows with the image; what the layer shows comes only now.
    new_image.scale(width, height)
    write(new.get_buffer(), 0, 0, mosaic)
    new.update(0, 0, width, height)
    _, x_per_inch, y_per_inch = image.get_resolution()
    new_image.set_resolution(x_per_inch * width / part.width, y_per_inch * height / part.height)
    new_image.undo_enable()
    return new


def ask_person(procedure, config):
    """Shows the settings; False if they are cancelled."""
    gi.require_version("GimpUi", "3.0")
    gi.require_version("Gtk", "3.0")
    from gi.repository import GimpUi, Gtk

    GimpUi.init(PROCEDURE)
    dialog = GimpUi.ProcedureDialog.new(procedure, config, "smalti: lay the picture in tiles")
    labels = Gtk.SizeGroup.new(Gtk.SizeGroupMode.HORIZONTAL)
    for name, title, properties in (
        ("tiles", "Tiles", ("style", "mask", "tiles", "grout", "grout-color")),
        ("search", "Search", ("size", "evals", "seed")),
        ("result", "Result", ("scale", "new-layer")),
    ):
        for entry in properties:
            widget = dialog.get_widget(entry, GObject.TYPE_NONE)
            if isinstance(widget, GimpUi.Labeled):
                labels.add_widget(widget.get_label())
            if isinstance(widget, GimpUi.LabelSpin):
                # Entries of one width are easier to read, however large their numbers may be.
                widget.get_spin_button().set_width_chars(9)
            if entry in HINTS:
                widget.attach(Gtk.Label(label=HINTS[entry], xalign=0, visible=True), 3, 0, 1, 1)
        dialog.get_label(f"{name}-title", title, False, False)
        dialog.fill_box(f"{name}-box", properties).set_spacing(6)
        frame = dialog.fill_frame(f"{name}-frame", f"{name}-title", False, f"{name}-box")
        frame.set_margin_bottom(12)
    other_seed = Gtk.Button(label="Another", tooltip_text="Takes a seed by chance", visible=True)
    other_seed.connect("clicked", lambda _: config.set_property("seed", random.randrange(SEED_MAX + 1)))
    dialog.get_widget("seed", GObject.TYPE_NONE).attach(other_seed, 3, 0, 1, 1)
    dialog.fill(["tiles-frame", "search-frame", "result-frame"])

    def follow(*_):
        of_one_color, is_as_large = config.get_property("grout") == "color", config.get_property("scale") == 1
        dialog.get_widget("grout-color", GObject.TYPE_NONE).set_sensitive(of_one_color)
        dialog.get_widget("new-layer", GObject.TYPE_NONE).set_sensitive(is_as_large)

    config.connect("notify::grout", follow)
    config.connect("notify::scale", follow)
    follow()
    is_agreed = dialog.run()
    dialog.destroy()
    return is_agreed


def lead_a_group():
    """Makes this process the leader of a group of its own: GIMP kills that as a whole when a person cancels."""
    if hasattr(os, "setpgid") and os.getpgid(0) != os.getpid():
        os.setpgid(0, 0)


def run(procedure, run_mode, image, drawables, config, _data):
    try:
        layer = only_layer(image, drawables)
        program = smalti_program.find()
        part = Part(image, layer)
        if run_mode == Gimp.RunMode.INTERACTIVE:
            if not ask_person(procedure, config):
                return procedure.new_return_values(Gimp.PDBStatusType.CANCEL, None)
            # Another selection may have been made behind the dialog.
            part = Part(image, layer)
        is_apart = config.get_property("scale") != 1
        is_over = not is_apart and not config.get_property("new-layer")
        if is_over and layer.get_lock_content():
            raise Refused("The layer's pixels are locked; unlock them, or lay the mosaic on a new layer")
        lead_a_group()
        Gimp.progress_init("smalti lays tiles")
        mosaic = evolved(program, part, config, Gimp.progress_update)
        if not layer.is_valid():
            raise Refused("The layer was deleted while its mosaic evolved")
    except smalti_program.Cancelled:
        return procedure.new_return_values(Gimp.PDBStatusType.CANCEL, None)
    except Refused as refusal:
        failure = GLib.Error.new_literal(Gimp.PlugIn.error_quark(), str(refusal), 0)
        return procedure.new_return_values(Gimp.PDBStatusType.EXECUTION_ERROR, failure)
    laid = (lay_apart if is_apart else lay_over if is_over else lay_above)(part, mosaic)
    Gimp.progress_end()
    if run_mode != Gimp.RunMode.NONINTERACTIVE:
        if is_apart:
            Gimp.Display.new(laid.get_image())
        Gimp.displays_flush()
    values = procedure.new_return_values(Gimp.PDBStatusType.SUCCESS, None)
    values.remove(1)
    values.insert(1, GObject.Value(Gimp.Layer, laid))
    return values


def choice(names):
    found = Gimp.Choice.new()
    for number, (name, label) in enumerate(names):
        found.add(name, number, label, "")
    return found


class Smalti(Gimp.PlugIn):
    def do_set_i18n(self, _name):
        return False

    def do_query_procedures(self):
        return [PROCEDURE]

    def do_create_procedure(self, name):
        # Without it there are no colours, not even to be the default of an argument.
        Gegl.init(None)
        procedure = Gimp.ImageProcedure.new(self, name, Gimp.PDBProcType.PLUGIN, run, None)
        procedure.set_image_types("*")
        procedure.set_sensitivity_mask(Gimp.ProcedureSensitivityMask.DRAWABLE)
        procedure.set_menu_label("_smalti...")
        procedure.add_menu_path("<Image>/Filters/Artistic")
        procedure.set_documentation(
            "Lay the picture in tiles",
            "Evolves a mosaic of the layer, or of the selected part of it, by the program smalti. It comes as a new "
            "layer, instead of the layer's pixels, or at another scale as a new image.",
            # A button for help would lead to a page that GIMP's manual does not have.
            None,
        )
        procedure.set_attribution("smalti", "smalti", "")
        self.add_arguments(procedure)
        procedure.add_layer_return_value(
            "layer", "Layer", "The layer with the mosaic", True, GObject.ParamFlags.READWRITE
        )
        return procedure

    def add_arguments(self, procedure):
        mode = GObject.ParamFlags.READWRITE
        says = "What the mosaic looks like"
        procedure.add_choice_argument("style", "St_yle", says, choice(smalti_program.STYLES), "mosaic", mode)
        says = "Shape of the tiles"
        procedure.add_choice_argument("mask", "Sha_pe", says, choice(smalti_program.MASKS), "auto", mode)
        says = "How many tiles; 0 takes what suits the size of the picture"
        procedure.add_int_argument("tiles", "_Number", says, 0, 1_000_000, 0, mode)
        says = "What is seen between the tiles"
        procedure.add_choice_argument("grout", "_Grout", says, choice(smalti_program.GROUTS), "style", mode)
        says = "For grout of one colour"
        procedure.add_color_argument("grout-color", "Colo_ur", says, False, Gegl.Color.new(GROUT_COLOR), mode)
        says = "Longer side in pixels of what evolves; it is drawn at full size. More show finer detail and take longer"
        procedure.add_int_argument("size", "E_volve at", says, 16, 8192, 512, mode)
        says = "How many changes are tried; 0 tries 400 a tile. More come closer to the picture and take longer"
        procedure.add_int_argument("evals", "E_ffort", says, 0, 2_000_000_000, 0, mode)
        says = "Decides every random choice: the same seed makes the same mosaic again"
        procedure.add_int_argument("seed", "See_d", says, 0, SEED_MAX, 0, mode)
        says = "1 keeps the size; any other makes a new image of that scale, with the tiles drawn anew"
        procedure.add_double_argument("scale", "Outpu_t scale", says, 0.1, 16.0, 1.0, mode)
        says = "Lays the mosaic on a layer of its own, above; otherwise it replaces the layer's pixels"
        procedure.add_boolean_argument("new-layer", "On a ne_w layer", says, True, mode)


Gimp.main(Smalti.__gtype__, sys.argv)
