"""Runs in Krita without a window: what the plug-in makes of layers of all kinds, compared with what the program makes.

kritarunner -s headless
"""

import os
import time
import traceback

from doors import (
    FEW,
    PROGRAM,
    SCRATCH,
    SRGB,
    check,
    children,
    end,
    new_document,
    painted,
    photo,
    pixels,
    program_made,
    same,
    script,
    select,
)
from krita import InfoObject, Krita, Selection
from smalti.mosaic import Mosaic, new_mask
from smalti.qt import QtWidgets
from smalti.smalti_program import Cancelled, Options, Refused, find


def lay(document, node, progress=None, **options):
    """Has the plug-in make a mosaic of a layer."""
    mosaic = Mosaic(document, [node])
    chosen = Options(**{**FEW, **options})
    chosen.output_size = mosaic.output_size(chosen.size)
    layer = mosaic.make(PROGRAM, chosen, progress)
    document.waitForDone()
    return layer


def refusal(act):
    """The sentence with which something is refused."""
    try:
        act()
    except Refused as error:
        return str(error)
    return None


def names(nodes):
    return [node.name() for node in nodes]


def box(rect):
    return rect.x(), rect.y(), rect.width(), rect.height()


def makes_what_the_program_makes():
    document, layer = painted(128, 96)
    made = lay(document, layer)
    same(pixels(made, 0, 0, 128, 96), program_made(photo(128, 96), 128, 96), "a layer gives the program's pixels")
    same(names(document.topLevelNodes()), ["Ground", "Ground (smalti)"], "the mosaic lies above its layer")
    same(pixels(layer, 0, 0, 128, 96), photo(128, 96), "the layer stays as it was")
    flags = "--style paint --mask disc --grout #ff0000 --seed 9 --tiles 50 --evals 1500".split()
    other = lay(
        document, layer, style="paint", mask="disc", grout="color", grout_color="#ff0000", seed=9, tiles=50, evals=1500
    )
    same(pixels(other, 0, 0, 128, 96), program_made(photo(128, 96), 128, 96, *flags), "options reach the program")
    document.close()


def draws_in_full_size():
    document, layer = painted(201, 67)
    made = lay(document, layer, size=64)
    same(box(made.bounds()), (0, 0, 201, 67), "what evolves smaller is drawn as large as its layer")
    document.close()
    document, layer = painted(128, 96)
    made = lay(document, layer, size=64)
    flags = "--style mosaic --size 64 --output-size 128 --tiles 60 --evals 2000 --seed 5".split()
    expected = program_made(photo(128, 96), 128, 96, *flags)
    same(pixels(made, 0, 0, 128, 96), expected, "and has the program's own pixels then, too")
    document.close()


def keeps_place_and_transparency():
    document, ground = painted(200, 150)
    group = document.createNode("Group", "grouplayer")
    document.rootNode().addChildNode(group, None)
    layers = [document.createNode(name, "paintlayer") for name in ("Below", "Source", "Above")]
    for layer in layers:
        group.addChildNode(layer, None)
    source = layers[1]
    half = bytearray(photo(100, 80))
    for row in range(80):
        half[row * 400 + 3 : row * 400 + 200 : 4] = bytes(50)
    source.setPixelData(bytes(half), 37, 21, 100, 80)
    document.refreshProjection()
    document.waitForDone()
    made = lay(document, source)
    same(names(group.childNodes()), ["Below", "Source", "Source (smalti)", "Above"], "it lies in the same group")
    seen = bytes(half)
    cut = b"".join(seen[row * 400 + 200 : row * 400 + 400] for row in range(80))
    same(pixels(made, 87, 21, 50, 80), program_made(cut, 50, 80), "clear pixels around a layer are left out")
    check(not any(pixels(made, 37, 21, 50, 80)[3::4]), "what is clear stays clear")
    outside = document.createNode("Outside", "paintlayer")
    group.addChildNode(outside, None)
    outside.setPixelData(photo(100, 80), 150, -40, 100, 80)
    made = lay(document, outside)
    same(box(made.bounds()), (150, 0, 50, 40), "only what lies on the canvas evolves")
    document.close()


def keeps_a_selection():
    document, layer = painted(160, 120)
    selection = Selection()
    selection.select(30, 20, 90, 70, 255)
    selection.feather(8)
    selection.select(60, 40, 30, 30, 0)
    document.setSelection(selection)
    where = (selection.x(), selection.y(), selection.width(), selection.height())
    soft = selection.pixelData(*where).data()
    check(len(set(soft)) > 20, "(the selection of this check is soft)")
    cut = bytearray(pixels(layer, *where))
    for index, value in enumerate(soft):
        if not value:
            cut[index * 4 + 3] = 0
    made = lay(document, layer)
    same(pixels(made, *where), program_made(bytes(cut), where[2], where[3]), "only what is selected evolves")
    masks = made.childNodes()
    same([mask.type() for mask in masks], ["transparencymask"], "the mosaic has a transparency mask")
    same(pixels(masks[0], *where), soft, "the mask is as soft as the selection")
    check(not any(pixels(masks[0], 0, 0, 160, where[1])), "the mask hides what lies outside")
    same(document.selection().pixelData(*where).data(), soft, "the selection stays")
    shown = made.projectionPixelData(*where).data()[3::4]
    check(shown[0] == soft[0] and 0 < shown[len(shown) // 5] <= 255, "the mask is at work")
    saved = os.path.join(SCRATCH, "masked.kra")
    document.saveAs(saved)
    document.close()
    document = Krita.instance().openDocument(saved)
    again = document.nodeByName("Ground (smalti)")
    same(pixels(again.childNodes()[0], *where), soft, "a saved picture has the mask")
    document.close()


def takes_colours_of_all_kinds():
    before = len(Krita.instance().documents())
    for model, depth, profile in (
        ("GRAYA", "U8", "Gray-D50-elle-V2-srgbtrc.icc"),
        ("GRAYA", "U16", "Gray-D50-elle-V2-g10.icc"),
        ("RGBA", "U8", "ClayRGB-elle-V2-g22.icc"),
        ("RGBA", "U16", "sRGB-elle-V2-srgbtrc.icc"),
        ("RGBA", "F16", "sRGB-elle-V2-g10.icc"),
        ("RGBA", "F32", "Rec2020-elle-V4-g10.icc"),
        ("CMYKA", "U8", "Chemical proof"),
        ("LABA", "U16", "Lab identity built-in"),
        ("YCbCrA", "U8", "ITU-R BT.709-6 YCbCr ICC V4 profile"),
    ):
        document, layer = painted(96, 64)
        if not document.setColorSpace(model, depth, profile):
            check(False, f"(Krita has {model} {depth} {profile})")
            continue
        seen = document.clone()
        seen.setColorSpace(*SRGB)
        given = pixels(seen.topLevelNodes()[0], 0, 0, 96, 64)
        seen.close()
        made = lay(document, layer)
        kind = f"{model} {depth} {document.colorProfile()}"
        same((made.colorModel(), made.colorDepth(), made.colorProfile()),
             (document.colorModel(), document.colorDepth(), document.colorProfile()), f"{kind}: kept")  # fmt: skip
        expected = new_document(96, 64)
        expected.topLevelNodes()[0].setPixelData(program_made(given, 96, 64), 0, 0, 96, 64)
        expected.setColorSpace(model, depth, profile)
        same(pixels(made, 0, 0, 96, 64), pixels(expected.topLevelNodes()[0], 0, 0, 96, 64), f"{kind}: the same pixels")
        expected.close()
        document.close()
    same(len(Krita.instance().documents()), before, "no hidden picture is left behind")


def takes_layers_of_all_kinds():
    document, layer = painted(120, 90)
    root = document.rootNode()
    group = document.createGroupLayer("Group")
    root.addChildNode(group, None)
    member = document.createNode("Member", "paintlayer")
    group.addChildNode(member, None)
    member.setPixelData(photo(60, 40), 10, 10, 60, 40)
    everything = Selection()
    everything.select(0, 0, 120, 90, 255)
    color = InfoObject()
    color.setProperty("color", "#208040")
    fill = document.createFillLayer("Fill", "color", color, everything)
    root.addChildNode(fill, None)
    clone = document.createCloneLayer("Clone", layer)
    root.addChildNode(clone, None)
    file_layer = document.createFileLayer("File", os.environ["PHOTO"], "None")
    root.addChildNode(file_layer, None)
    document.refreshProjection()
    document.waitForDone()
    masked = document.createNode("Masked", "paintlayer")
    masked.setPixelData(photo(60, 40), 40, 30, 60, 40)
    mask = new_mask(document)
    mask.setPixelData(b"\xff" * 30 * 40, 40, 30, 30, 40)
    masked.setChildNodes([mask])
    root.addChildNode(masked, None)
    for node in (group, fill, clone, file_layer, masked):
        evolves_as_it_is_seen(document, node)
    document.close()
    drawing = os.path.join(SCRATCH, "drawing.svg")
    with open(drawing, "w", encoding="utf-8") as file:
        file.write('<svg xmlns="http://www.w3.org/2000/svg" width="120" height="90"><circle cx="50" cy="40" r="30"/>')
        file.write("</svg>")
    document = Krita.instance().openDocument(drawing)
    vectors = [node for node in document.topLevelNodes() if node.type() == "vectorlayer"]
    evolves_as_it_is_seen(document, vectors[0])
    document.close()


def evolves_as_it_is_seen(document, node):
    """Checks the mosaic of a layer against its projection."""
    for _ in range(100):
        # Krita fills layers, reads their files and draws their shapes when it finds the time.
        x, y, width, height = box(node.bounds() & document.bounds())
        seen = node.projectionPixelData(x, y, width, height).data()
        if any(seen):
            break
        QtWidgets.QApplication.processEvents()
        time.sleep(0.05)
    check(any(seen), f"(the layer {node.name()} shows something)")
    made = lay(document, node)
    kind = f"{node.type()} named {node.name()}"
    same(pixels(made, x, y, width, height), program_made(seen, width, height), f"a {kind} evolves as it is seen")


def refuses():
    document, layer = painted(64, 48)
    root = document.rootNode()

    def of(nodes):
        return refusal(lambda: Mosaic(document, nodes))

    same(refusal(lambda: Mosaic(None, [])), "There is no picture. Open one first", "no picture is refused")
    same(of([]), "No layer is selected. Select one", "no layer is refused")
    same(of([layer, layer]), "Several layers are selected. Select one", "several layers are refused")
    empty = document.createNode("Empty", "paintlayer")
    root.addChildNode(empty, None)
    same(of([empty]), "The layer Empty has no pixels in the picture", "an empty layer is refused")
    group = document.createGroupLayer("Group")
    root.addChildNode(group, None)
    group.setPassThroughMode(True)
    check("passed through" in str(of([group])), "a group that is passed through is refused")
    mask = document.createTransformMask("Mask")
    layer.addChildNode(mask, None)
    same(of([mask]), "Mask is a transform mask, which has no pixels to evolve. Select a layer", "a mask is refused")
    layer.setVisible(False)
    same(of([layer]), "The layer Ground is hidden. Show it first", "a hidden layer is refused")
    document.close()
    document, layer = painted(64, 48)
    select(document, 100, 100, 20, 20)
    same(of([layer]), "The selection does not touch the layer Ground", "a selection beside the layer is refused")
    select(document, 0, 0, 0, 0)
    same(of([layer]), "The selection is empty", "an empty selection is refused")
    document.close()
    # Larger than a pipe holds: a program that ends without reading must not end Krita.
    document, layer = painted(256, 256)
    mosaic = Mosaic(document, [layer])
    failing = script("failing", "sleep 0.3; echo 'smalti: the moon is in the way' >&2; exit 1\n")
    said = refusal(lambda: mosaic.make(failing, Options()))
    same(said, "the moon is in the way", "a program that fails says why")
    liar = script("liar", "cat >/dev/null; echo nothing\n")
    said = refusal(lambda: mosaic.make(liar, Options()))
    check("cannot read the mosaic" in str(said), "a result that is none is refused")
    same(names(document.topLevelNodes()), ["Ground"], "and no layer is laid")
    old = script("old", "echo smalti 0.0.9\n")
    check("is smalti 0.0.9, and this plug-in needs" in str(refusal(lambda: find(old))), "an older program is refused")
    check("is no program" in str(refusal(lambda: find("/no/where"))), "a program that is not there is refused")
    document.close()
    document, layer = painted(1, 1)
    said = refusal(lambda: lay(document, layer))
    check(said is None or "px" in said, f"a layer of one pixel: {said or 'works'}")
    document.close()


def cancels():
    document, layer = painted(128, 96)
    began = time.monotonic()
    shares = []

    def progress(share):
        shares.append(share)
        return share < 0.1

    stopped = False
    try:
        lay(document, layer, progress, evals=2_000_000)
    except Cancelled:
        stopped = True
    check(stopped, "work can be cancelled")
    rate = len(shares) / (time.monotonic() - began)
    check(rate > 5, f"progress is told {rate:.0f} times a second")
    check(shares == sorted(shares) and len(set(shares)) > 1 and shares[-1] < 0.9, "and grows")
    same(children(), [], "the program is gone then")
    same(names(document.topLevelNodes()), ["Ground"], "and the picture is as it was")
    document.close()


def leaves_no_files():
    document, layer = painted(128, 96)
    seen = set()

    def progress(_share):
        for folder, _, files in os.walk(SCRATCH):
            seen.update(os.path.join(folder, name) for name in files)

    progress(0)
    before = set(seen)
    lay(document, layer, progress)
    progress(1)
    new = {path for path in seen - before if not os.path.basename(path).startswith("KRITA_SWAP")}
    same(new, set(), "no file is written, not even for a moment")
    document.close()


def __main__(*_arguments):
    Krita.instance().setBatchmode(True)
    print("Krita", Krita.instance().version(), flush=True)
    for part in (
        makes_what_the_program_makes,
        draws_in_full_size,
        keeps_place_and_transparency,
        keeps_a_selection,
        takes_colours_of_all_kinds,
        takes_layers_of_all_kinds,
        refuses,
        cancels,
        leaves_no_files,
    ):
        try:
            part()
        except Exception:
            traceback.print_exc()
            check(False, f"{part.__name__} ran to its end")
    end()
