"""What the plug-in does in GIMP 3 without a window; GIMP's python-fu-eval runs it in the room that `run` makes.

Mosaics are compared pixel for pixel with what the program makes of a PNG that GIMP itself has written. The last line of
/room/checks tells how many checks failed; without it, GIMP has not come so far.
"""

import os
import subprocess
import tempfile
import traceback

import gi

gi.require_version("GdkPixbuf", "2.0")
from gi.repository import GdkPixbuf, Gegl, Gimp, Gio

ROOM = "/room"
RGBA = "R'G'B'A u8"
#: A search that takes no time, and what it is called in the plug-in.
QUICK_FLAGS = ["--tiles", "60", "--evals", "6000", "--seed", "5"]
QUICK = {"tiles": 60, "evals": 6000, "seed": 5}

out = open(f"{ROOM}/checks", "w", encoding="utf-8")
failed = 0


def check(what, is_true, *details):
    global failed
    failed += not is_true
    print("ok -" if is_true else "NOT OK -", what, *([] if is_true else details), file=out, flush=True)


def opened(path):
    return Gimp.file_load(Gimp.RunMode.NONINTERACTIVE, Gio.File.new_for_path(f"{ROOM}/{path}"))


def saved(image):
    """The path of a PNG that GIMP writes of an image."""
    path = tempfile.mktemp(suffix=".png", dir=f"{ROOM}/home")
    Gimp.file_save(Gimp.RunMode.NONINTERACTIVE, image, Gio.File.new_for_path(path), None)
    return path


def pixels(drawable, pixel_format=RGBA, at=None):
    x, y, width, height = at or (0, 0, drawable.get_width(), drawable.get_height())
    return drawable.get_buffer().get(Gegl.Rectangle.new(x, y, width, height), 1.0, pixel_format, Gegl.AbyssPolicy.NONE)


def put(drawable, content, pixel_format=RGBA):
    buffer = drawable.get_buffer()
    buffer.set(Gegl.Rectangle.new(0, 0, drawable.get_width(), drawable.get_height()), pixel_format, content)
    buffer.flush()
    drawable.update(0, 0, drawable.get_width(), drawable.get_height())


def rgb_image(width, height, content):
    """An image of one layer with these RGBA pixels."""
    image = Gimp.Image.new(width, height, Gimp.ImageBaseType.RGB)
    layer = Gimp.Layer.new(image, "picture", width, height, Gimp.ImageType.RGBA_IMAGE, 100, Gimp.LayerMode.NORMAL)
    image.insert_layer(layer, None, 0)
    put(layer, content)
    return image


def program(path, *flags):
    """The size and the RGBA pixels that the program makes of a file."""
    command = [f"{ROOM}/program", "evolve", path, "-o", "-", "--progress", "none", *flags]
    loader = GdkPixbuf.PixbufLoader.new_with_type("png")
    loader.write(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    loader.close()
    picture = loader.get_pixbuf().add_alpha(False, 0, 0, 0)
    return picture.get_width(), picture.get_height(), picture.read_pixel_bytes().get_data()


def seen(content):
    """RGBA pixels without the colours that nobody sees."""
    content = bytearray(content)
    for at in range(0, len(content), 4):
        if content[at + 3] == 0:
            content[at : at + 3] = bytes(3)
    return bytes(content)


def call(image, drawables, run_mode=Gimp.RunMode.NONINTERACTIVE, **settings):
    """Runs the plug-in; returns the new layer, or None, and what GIMP says."""
    procedure = Gimp.get_pdb().lookup_procedure("plug-in-smalti")
    config = procedure.create_config()
    config.set_property("run-mode", run_mode)
    config.set_property("image", image)
    config.set_core_object_array("drawables", drawables)
    for name, value in settings.items():
        config.set_property(name.replace("_", "-"), value)
    values = procedure.run(config)
    if values.index(0) == Gimp.PDBStatusType.SUCCESS:
        return values.index(1), ""
    return None, Gimp.get_pdb().get_last_error()


def refused(what, sentence, image, drawables, **settings):
    """Checks that the plug-in says a sentence and changes nothing."""
    before = [layer.get_id() for layer in image.get_layers()], len(Gimp.get_images())
    layer, said = call(image, drawables, **{**QUICK, **settings})
    after = [layer.get_id() for layer in image.get_layers()], len(Gimp.get_images())
    check(f"{what} is refused: {said}", layer is None and sentence in said and before == after, before, after)


def small_photo(width=96, height=64):
    image = opened("parrots.png")
    image.scale(width, height)
    return image


def check_styles():
    image = small_photo()
    layer = image.get_layers()[0]
    path = saved(image)
    grout = Gegl.Color.new("#4070c0")
    for settings, flags in (
        ({"style": "mosaic"}, ["--style", "mosaic"]),
        ({"style": "paint"}, ["--style", "paint"]),
        ({"style": "spray"}, ["--style", "spray"]),
        ({"style": "free"}, ["--style", "free"]),
        ({"style": "free", "mask": "hexagon"}, ["--style", "free", "--mask", "hexagon"]),
        ({"grout": "none"}, ["--style", "mosaic", "--grout", "none"]),
        ({"grout": "color", "grout_color": grout}, ["--style", "mosaic", "--grout", "#4070c0"]),
        ({"grout": "color"}, ["--style", "mosaic", "--grout", "#808080"]),
    ):
        new, said = call(image, [layer], **QUICK, **settings)
        _, _, expected = program(path, *QUICK_FLAGS, *flags)
        check(f"{' '.join(flags)}: the pixels of the program", new and pixels(new) == expected, said)
    new, said = call(image, [layer], Gimp.RunMode.WITH_LAST_VALS)
    _, _, expected = program(path, "--style", "mosaic")
    check(
        "with the values of the last time, which never was: those of the dialog", new and pixels(new) == expected, said
    )
    new, said = call(image, [layer], style="free", size=48, **QUICK)
    _, _, expected = program(path, *QUICK_FLAGS, "--size", "48", "--output-size", "96", "--style", "free")
    check("a layer larger than it evolves at is drawn anew at full size", new and pixels(new) == expected, said)
    image.delete()


def check_sizes():
    photo = small_photo()
    for width, height in ((97, 31), (1, 1), (1, 40), (3, 2)):
        image = photo.duplicate()
        image.scale(width, height)
        new, said = call(image, [image.get_layers()[0]], size=16, **QUICK)
        is_as_large = new is not None and (new.get_width(), new.get_height()) == (width, height)
        check(
            f"a layer of {width}x{height} px gets tiles of its size, or a sentence {said}",
            is_as_large or len(said) > 20,
        )
        image.delete()
    photo.delete()


def check_place():
    image = small_photo()
    layer = image.get_layers()[0]
    group = Gimp.GroupLayer.new(image, "group")
    image.insert_layer(group, None, 0)
    image.reorder_item(layer, group, 0)
    below = layer.copy()
    image.insert_layer(below, group, 1)
    layer.set_offsets(-10, 7)
    new, said = call(image, [layer], **QUICK)
    check(
        "the mosaic lies right above its source, in the same group",
        new and group.get_children()[:2] == [new, layer],
        said,
    )
    check("and at its place", new and new.get_offsets()[1:] == (-10, 7), new and new.get_offsets())
    check("the source is as it was", pixels(layer) == pixels(below))
    image.delete()


def cut_out(image, layer, box):
    """The path of a PNG of what the plug-in should evolve, made pixel by pixel."""
    x, y, width, height = box
    _, left, top = layer.get_offsets()
    content = bytearray(pixels(layer, at=box))
    selected = pixels(image.get_selection(), "Y float", (left + x, top + y, width, height))
    for pixel in range(width * height):
        if selected[4 * pixel : 4 * pixel + 4] == bytes(4):
            content[4 * pixel + 3] = 0
    other = rgb_image(width, height, bytes(content))
    path = saved(other)
    other.delete()
    return path


def check_selection():
    image = small_photo()
    layer = image.get_layers()[0]
    layer.set_offsets(5, 3)
    image.select_ellipse(Gimp.ChannelOps.REPLACE, 20, 10, 60, 50)
    Gimp.Selection.feather(image, 8)
    _, *box = layer.mask_intersect()
    width, height, expected = program(cut_out(image, layer, box), *QUICK_FLAGS, "--style", "mosaic")
    new, said = call(image, [layer], **QUICK)
    check("a selection: the program's pixels of what is selected", new and seen(pixels(new)) == seen(expected), said)
    check("at the place of the selection", new and new.get_offsets()[1:] == (box[0] + 5, box[1] + 3), said)
    at = (box[0] + 5, box[1] + 3, width, height)
    soft = pixels(image.get_selection(), "Y float", at)
    check("the selection is its mask, soft edges and all", new and pixels(new.get_mask(), "Y float") == soft)
    check("what is chosen is the layer, not its mask", new and image.get_selected_drawables() == [new])
    check("the selection is still there", not Gimp.Selection.is_empty(image))

    before = pixels(layer)
    mask = layer.create_mask(Gimp.AddMaskType.WHITE)
    layer.add_mask(mask)
    shades = bytes(x * 2 for _ in range(64) for x in range(96))
    put(mask, shades, "Y u8")
    new, said = call(image, [layer], **QUICK)
    shaded = b"".join(shades[96 * y + box[0] : 96 * y + box[0] + width] for y in range(box[1], box[1] + height))
    both = [one * other / 255 for one, other in zip(pixels(image.get_selection(), "Y u8", at), shaded)]
    found = pixels(new.get_mask(), "Y u8") if new else []
    close = len(found) == len(both) and all(abs(one - other) <= 1 for one, other in zip(found, both))
    check("where the source is masked, too, what either mask hides is hidden", close, said)
    check("the selection survives that", pixels(image.get_selection(), "Y float", at) == soft)
    Gimp.Selection.none(image)
    new, said = call(image, [layer], **QUICK)
    check("without a selection the mask of the source holds", new and pixels(new.get_mask(), "Y u8") == shades, said)
    check("and nothing is selected", Gimp.Selection.is_empty(image))
    check("the source is as it was", pixels(layer) == before)
    image.delete()


def check_over():
    image = small_photo()
    layer = image.get_layers()[0]
    before = pixels(layer)
    path = saved(image)
    new, said = call(image, [layer], new_layer=False, **QUICK)
    _, _, expected = program(path, *QUICK_FLAGS, "--style", "mosaic")
    check("not on a new layer: the layer's pixels are the program's", new == layer and pixels(layer) == expected, said)
    check("and there is no other layer", image.get_layers() == [layer])
    put(layer, before)
    box = (10, 20, 40, 30)
    image.select_rectangle(Gimp.ChannelOps.REPLACE, *box)
    _, _, expected = program(cut_out(image, layer, box), *QUICK_FLAGS, "--style", "mosaic")
    new, said = call(image, [layer], new_layer=False, **QUICK)
    check("of a selection, too", new and pixels(layer, at=box) == expected, said)
    now, was = bytearray(pixels(layer)), bytearray(before)
    for row in range(20, 50):
        now[4 * (96 * row + 10) : 4 * (96 * row + 50)] = was[4 * (96 * row + 10) : 4 * (96 * row + 50)]
    check("and the rest stays", now == was)
    put(layer, before)
    image.select_ellipse(Gimp.ChannelOps.REPLACE, *box)
    selected = pixels(image.get_selection(), "Y u8", box)
    for style in ("mosaic", "spray"):
        put(layer, before)
        was = pixels(layer, at=box)
        _, _, made = program(cut_out(image, layer, box), *QUICK_FLAGS, "--style", style)
        call(image, [layer], new_layer=False, **{**QUICK, "style": style})
        now = pixels(layer, at=box)
        worst = 0
        for at in (4 * pixel for pixel, share in enumerate(selected) if share == 255):
            alpha = made[at + 3]
            for channel in range(at, at + 3):
                wanted = (made[channel] * alpha + was[channel] * (255 - alpha)) / 255
                worst = max(worst, abs(now[channel] - wanted))
        check(f"{style} in an ellipse keeps a layer's pixels where it is clear", worst <= 2, worst)
    layer.set_lock_content(True)
    refused("a locked layer", "locked", image, [layer], new_layer=False)
    image.delete()


def check_kinds():
    photo = small_photo()
    grey = photo.duplicate()
    grey.convert_grayscale()
    indexed = photo.duplicate()
    indexed.convert_indexed(Gimp.ConvertDitherType.NONE, Gimp.ConvertPaletteType.GENERATE, 12, False, False, "")
    deep = photo.duplicate()
    deep.convert_precision(Gimp.Precision.U16_NON_LINEAR)
    linear = photo.duplicate()
    linear.convert_precision(Gimp.Precision.FLOAT_LINEAR)
    profiled = opened("wide_rgb.png")
    as_srgb = profiled.duplicate()
    intent = Gimp.ColorRenderingIntent.RELATIVE_COLORIMETRIC
    as_srgb.convert_color_profile(Gimp.ColorProfile.new_rgb_srgb(), intent, False)
    pairs = zip(pixels(profiled.get_layers()[0]), pixels(as_srgb.get_layers()[0]))
    is_close = max(abs(one - other) for one, other in pairs) <= 1
    check("what evolves of a profiled image is what GIMP shows of it", is_close)
    for what, image in (
        ("a grey image", grey),
        ("an indexed image", indexed),
        ("16 bits a channel", deep),
        ("linear floating point", linear),
        ("a colour profile", profiled),
        ("a grey file of 16 bits", opened("grey_16_bit.png")),
        ("a file with a palette", opened("palette.png")),
    ):
        layer = image.get_layers()[0]
        width, height = layer.get_width(), layer.get_height()
        source = rgb_image(width, height, pixels(layer))
        _, _, expected = program(saved(source), *QUICK_FLAGS, "--style", "mosaic")
        mosaic = rgb_image(width, height, expected)
        new, said = call(image, [layer], **QUICK)
        # GIMP's own conversion of the program's pixels.
        converted = Gimp.Layer.new_from_drawable(mosaic.get_layers()[0], image)
        is_same = new and pixels(new) == pixels(converted)
        check(f"{what}: the pixels of the program, as GIMP converts them", is_same, said)
        call(image, [layer], new_layer=False, **QUICK)
        check("instead of the layer's, too", pixels(layer) == pixels(converted))
        for old in (source, mosaic, image):
            old.delete()
    photo.delete()
    as_srgb.delete()


def check_alpha():
    image = opened("alpha.png")
    layer = image.get_layers()[0]
    new, said = call(image, [layer], **QUICK)
    _, _, expected = program(f"{ROOM}/alpha.png", *QUICK_FLAGS, "--style", "mosaic")
    check(
        "a layer with clear pixels: the program's pixels of the file", new and seen(pixels(new)) == seen(expected), said
    )
    check("some of which are clear, and some are not", new and set(pixels(new)[3::4]) == {0, 255})
    put(layer, bytes(len(pixels(layer))))
    refused("a layer of nothing", "clear", image, [layer])
    image.delete()


def check_apart():
    image = small_photo()
    image.set_resolution(100, 100)
    layer = image.get_layers()[0]
    path = saved(image)
    new, said = call(image, [layer], scale=2.0, **QUICK)
    width, height, expected = program(path, *QUICK_FLAGS, "--style", "mosaic", "--output-size", "192")
    other = new and new.get_image()
    check("twice as large: the program's pixels in an image of their own", new and pixels(new) == expected, said)
    check("of that size", new and (other.get_width(), other.get_height()) == (width, height) == (192, 128))
    check("and as large on paper", new and other.get_resolution()[1:] == (200, 200), new and other.get_resolution())
    check("the source image is as it was", image.get_layers() == [layer] and other != image)
    if new:
        other.delete()
    image.convert_indexed(Gimp.ConvertDitherType.NONE, Gimp.ConvertPaletteType.GENERATE, 12, False, False, "")
    image.select_ellipse(Gimp.ChannelOps.REPLACE, 20, 10, 60, 40)
    Gimp.Selection.feather(image, 8)
    width = layer.mask_intersect()[3]
    new, said = call(image, [layer], scale=0.5, **QUICK)
    other = new and new.get_image()
    check(
        "half as large, of an indexed image: one of RGB",
        new and other.get_base_type() == Gimp.ImageBaseType.RGB and abs(other.get_width() - width / 2) <= 1,
        said,
    )
    mask = new and new.get_mask()
    soft = mask and pixels(mask, "Y u8")
    check(
        "with the selection as its mask, half as large and soft",
        mask
        and (mask.get_width(), mask.get_height()) == (other.get_width(), other.get_height())
        and len(set(soft)) > 20,
    )
    if new:
        other.delete()
    image.delete()


def check_effects():
    image = small_photo()
    layer = image.get_layers()[0]
    layer.append_filter(Gimp.DrawableFilter.new(layer, "gegl:invert-gamma", ""))
    path = saved(image)
    before = pixels(layer)
    new, said = call(image, [layer], **QUICK)
    _, _, expected = program(path, *QUICK_FLAGS, "--style", "mosaic")
    check("a layer with an effect: what is seen of it evolves", new and pixels(new) == expected, said)
    check("and the effect is still there", len(layer.get_filters()) == 1 and pixels(layer) == before)
    image.delete()


def check_refusals():
    image = small_photo()
    layer = image.get_layers()[0]
    second = layer.copy()
    image.insert_layer(second, None, 0)
    group = Gimp.GroupLayer.new(image, "group")
    image.insert_layer(group, None, 0)
    channel = Gimp.Channel.new(image, "channel", 96, 64, 50, Gegl.Color.new("red"))
    image.insert_channel(channel, None, 0)
    mask = layer.create_mask(Gimp.AddMaskType.WHITE)
    layer.add_mask(mask)
    refused("more than one layer", "one layer at a time", image, [layer, second])
    refused("no layer", "one layer at a time", image, [])
    refused("a group", "group", image, [group])
    refused("a mask", "mask", image, [mask])
    refused("a channel", "channel", image, [channel])
    second.set_offsets(60, 0)
    image.select_rectangle(Gimp.ChannelOps.REPLACE, 0, 0, 30, 30)
    refused("a selection beside the layer", "selection", image, [second])
    Gimp.edit_copy([layer])
    (floating,) = Gimp.edit_paste(layer, True)
    refused("a floating selection", "floating selection", image, [floating])
    refused("a layer under a floating selection", "floating selection", image, [layer])
    Gimp.floating_sel_remove(floating)
    Gimp.Selection.none(image)

    os.remove(f"{ROOM}/smalti")
    refused("a program that is not there", "SMALTI", image, [layer])
    for what, script, sentence in (
        ("an older program", "echo smalti 0.0.9", "smalti 0.0.9"),
        ("another program", "echo sed 4.9", "not smalti"),
        (
            "a program that fails",
            '[ "$1" = --version ] && exec /room/program "$1"; echo smalti: no luck >&2; exit 1',
            "no luck",
        ),
        ("a program that dies", '[ "$1" = --version ] && exec /room/program "$1"; kill -9 $$', "exit code"),
        (
            "a program that writes rubbish",
            '[ "$1" = --version ] && exec /room/program "$1"; echo rubbish',
            "no picture",
        ),
    ):
        with open(f"{ROOM}/smalti", "w", encoding="utf-8") as file:
            file.write(f"#!/bin/sh\n{script}\n")
        os.chmod(f"{ROOM}/smalti", 0o755)
        refused(what, sentence, image, [layer])
    os.remove(f"{ROOM}/smalti")
    os.symlink("program", f"{ROOM}/smalti")
    image.delete()


def check_nothing_is_left():
    found = [file for _, _, files in os.walk(f"{ROOM}/tmp") for file in files]
    check("no file is left", not found, found)
    check("no image is left", not Gimp.get_images(), Gimp.get_images())


for group_of_checks in (
    check_styles,
    check_sizes,
    check_place,
    check_selection,
    check_over,
    check_kinds,
    check_alpha,
    check_apart,
    check_effects,
    check_refusals,
    check_nothing_is_left,
):
    try:
        group_of_checks()
    except Exception:
        check(f"{group_of_checks.__name__} comes to its end", False, traceback.format_exc())
print(failed, "failed", file=out, flush=True)
