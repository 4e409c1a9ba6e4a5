"""The cases of tools/same-bytes: short bash scripts, and the small files that they read beside the photos of the tests.

A case runs in a fresh folder that holds the files its script names. `smalti` in a script is the program under test.
"""

import dataclasses
import re
import struct
import zlib

# ---------------------------------------------------------------------------------------------------------------------
# Files that cases read, beside the photos of the tests. A case gets those whose names are in its script.


def png(width_px, height_px, pixel, channels=3):
    """A PNG of 8-bit pixels; `pixel(x, y)` gives as many values as there are channels (1 grey, 3 RGB, 4 RGBA)."""

    def chunk(kind, content):
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    rows = b"".join(
        b"\0" + bytes(value & 255 for x in range(width_px) for value in pixel(x, y)) for y in range(height_px)
    )
    header = struct.pack(">IIBBBBB", width_px, height_px, 8, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def frame(number, width_px=48, height_px=36):
    """A frame of a sequence: a disc that moves over a still ground."""

    def pixel(x, y):
        if (x - 8 - 5 * number) ** 2 + (y - 18) ** 2 < 40:
            return 240, 200, 40
        return x * 5, y * 6, x * y % 97

    return png(width_px, height_px, pixel)


def other_frame(number):
    """A frame of another shot."""
    return png(48, 36, lambda x, y: (250 - 3 * y, 250 - 2 * x, 90 + 9 * number * (x // 24)))


FIXTURES = {
    "photo.png": png(40, 30, lambda x, y: (x * 6, y * 8, x * y % 251)),
    "map.png": png(64, 64, lambda x, y: (255 if (x - 32) ** 2 + (y - 32) ** 2 < 300 else 10 * (x // 8),), 1),
    "glass.png": png(60, 40, lambda x, y: (x * 4, y * 6, 128, x * 255 // 59), 4),
    "half.png": png(30, 30, lambda x, y: (255 if x < 15 else y * 4,), 1),
    "stripe.png": png(64, 3, lambda x, y: (x * 4, 80 * y, 100)),
    "dot.png": png(1, 1, lambda x, y: (200, 30, 60)),
    "few.png": png(8, 8, lambda x, y: ((x // 4) * 200, (y // 4) * 200, 60)),
    "tent.svg": b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 10"><path d="M0 10L5 0L10 10z"/></svg>',
    "ring.svg": b'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 100"><path fill-rule="evenodd" '
    b'd="M5 5H95V95H5Z M30 30H70V70H30Z"/></svg>',
    "three.hex": b"102030\nffcc00\nd04060\n",
    "own.gpl": b"GIMP Palette\nName: own\n#\n  0   0   0 night\n240 230 200 sand\n 40 120  60 leaf\n200  60  40 rust\n",
    "own.pal": b"JASC-PAL\r\n0100\r\n3\r\n0 0 0\r\n255 255 255\r\n40 120 200\r\n",
    "own.toml": b"""style = "mosaic"
tiles = 120
size = 64
evals = 3000
candidates = 2
color-mode = "mean"
background = "336699"
grout = "102030"
grout-width = 0.1
side = [0.5, 2.0]
aspect = 2.5
birth-side = [0.7, 1.4]
overlap = 20
hole = 120
turn = 60
angle-spread-deg = 3.0
coherence = 10
guide = "flow"
smoothing = 2.0
size-strength = 0.6
ground = "grout"
recolor = 0.5
masks = ["disc", "tent.svg"]
shader = "emboss"
""",
    "strokes.toml": b"""style = "paint"
tiles = 150
size = 64
evals = 4000
stroke = true
guide = "edges"
ground = "mean"
masks = ["brush"]

[[classes]]
share = 0.2
scale = 2.0
first-round = 0
[[classes]]
share = 0.8
scale = 0.7
first-round = 4
""",
    "glaze.toml": b'style = "spray"\nopacity = 0.5\nblend = "translucent"\nmasks = ["flower"]\ncolors = "12"\n',
    "ends.toml": b'evals = 500000\npatience = 4000\ntarget-sae = 300000\nsize = 48\ntiles = 80\nground = "black"\n',
    "flags.toml": b"""size = 64
device = "cpu"
threads = 1

[evolve]
tiles = 90
evals = "2k"
style = "mosaic"
mask = ["disc", "hexagon"]
output = ["from-config.png"]

[batch]
style = "spray"
tiles = 60
evals = 1500
format = ["png", "npz"]

[plan]
style = "paint"
tiles = 70
picture-time = "3s"

[render]
background = "white"
output-size = 80

[score]
json = true
""",
    **{f"clip/f{number}.png": frame(number) for number in range(4)},
    **{f"cuts/{number}.png": frame(number) for number in range(3)},
    **{f"cuts/{number}.png": other_frame(number) for number in range(3, 6)},
    "odd/1.png": frame(1),
    "odd/2.png": frame(2, 40, 30),
    "work.jsonl": b"""{"input": "rgb.png", "params": {"evals": 700}}
{"input": "plain.jpg", "id": "poster", "seed": 7, "preset": "mosaic", "params": {"tiles": 80, "grout": "auto", "evals": "1k"}, "output": ["poster.png", "poster.svg", "poster.npz"]}
{"input": "alpha.png", "id": "b1", "group": "pair", "params": {"mask": ["disc", "hexagon"], "background": "white", "evals": 700}}
{"input": "grey.png", "id": "b2", "group": "pair", "after": "b1", "params": {"scheme": "paper", "births": 300, "no-rotation": true, "evals": null}}
{"input": "lossy.webp", "id": "c", "params": {"style": "spray", "candidates": 2, "evals": 700, "no-rotation": false}}
""",
    "chain.jsonl": b"""{"input": "rgb.png", "id": "third", "group": "g", "after": "second"}
{"input": "plain.jpg", "id": "second", "group": "g", "after": "first"}
{"input": "alpha.png", "id": "first", "group": "g"}
{"input": "bad.png", "id": "broken", "group": "g"}
{"input": "rgb.png", "id": "never", "group": "g", "after": "broken"}
{"input": "rgb.png", "id": "nor this", "group": "g", "after": "never"}
""",
    "circle.jsonl": b"""{"input": "rgb.png", "id": "one", "group": "g", "after": "two"}
{"input": "rgb.png", "id": "two", "group": "g", "after": "one"}
""",
    "weird.jsonl": b'{"input": "rgb.png", "params": {"threads": 3}}\n',
    "torn.jsonl": b'{"input": "rgb.png"}\n{"input": \n',
    "bad.png": b"This is no picture, whatever its name says.",
    "notes.csv": b"mine,yours\n1,2\n",
}


# ---------------------------------------------------------------------------------------------------------------------
# The cases.


@dataclasses.dataclass
class Case:
    name: str
    script: str
    # Lines of stdout come from several threads in any order.
    unordered: bool = False
    # All that the case prints and writes is text for people: help, manuals.
    words: bool = False
    # Files of which only the existence counts.
    exists: tuple = ()
    # Programs and devices without which the case is skipped: "ffmpeg", "llvmpipe".
    needs: tuple = ()


CASES = []
GPU = "--device name:llvmpipe"


def case(name, script, **options):
    CASES.append(Case(name, script.strip(), **options))


def cells(name, flags, photo="parrots.png", **options):
    """A small search in cells."""
    count = "" if re.search(r"(^| )(-n|--init)\b", flags) else "-n 120"
    size = "" if "--size" in flags else "--size 64"
    evals = "" if "--evals" in flags else "--evals 2500"
    case(f"cells/{name}", f"smalti evolve {photo} {size} {count} {evals} --json -o a.png -o a.npz {flags}", **options)


def paper(name, flags, photo="parrots.png", **options):
    """A small run of the published algorithm."""
    count = "" if re.search(r"(^| )(-n|--init)\b", flags) else "-n 100"
    size = "" if "--size" in flags else "--size 64"
    births = "" if "--births" in flags else "--births 1200"
    line = f"smalti evolve {photo} --scheme paper {size} {count} {births} --json -o a.png -o a.npz {flags}"
    case(f"paper/{name}", line, **options)


def slug(flags):
    return re.sub(r"[^A-Za-z0-9.]+", "-", flags).strip("-")


STYLES = ("free", "mosaic", "paint", "spray")
MASKS = ("square", "border", "lines", "flower", "disc", "triangle", "hexagon", "brush")
SHADERS = ("template", "flat", "outline", "emboss", "soft", "hollow", "negative", "fade", "wash")


def styles_masks_and_shaders():
    for style in STYLES:
        cells(f"style-{style}", f"--style {style}")
        cells(f"style-{style}-large", f"--style {style} --size 128 -n 500 --evals 15k")
        cells(f"style-{style}-preset", f"--preset {style} --seed 3")
        cells(f"style-{style}-portrait", f"--style {style} --seed 11", photo="woman.jpg")
        cells(f"style-{style}-transparent", f"--style {style}", photo="alpha.png")
        cells(f"style-{style}-candidates", f"--style {style} --candidates 4")
        cells(f"style-{style}-two-threads", f"--style {style} --size 128 -n 400 --evals 8k --threads 2")
        cells(f"style-{style}-glass", f"--style {style} --opacity 0.6", photo="glass.png")
        cells(f"style-{style}-weight", f"--style {style} --weight map.png")
        cells(f"style-{style}-mode-mean", f"--style {style} --color-mode mean")
        cells(f"style-{style}-mode-pick", f"--style {style} --color-mode pick")
        for mask in MASKS:
            cells(f"style-{style}-mask-{mask}", f"--style {style} --mask {mask}")
        for shader in SHADERS:
            cells(f"style-{style}-shader-{shader}", f"--style {style} --shader {shader}")
    for mask, shader in zip(MASKS, SHADERS[1:]):
        for blend in ("--blend opaque", "--blend translucent", "--opacity 0.5"):
            cells(f"look-{mask}-{shader}-{slug(blend)}", f"--mask {mask} --shader {shader} {blend}")
    for flags in (
        "--mask flower,disc",
        "--mask flower --mask disc --mask disc",
        "--mask tent.svg",
        "--mask ring.svg",
        "--mask half.png",
        "--mask alpha.png --shader flat",
        "--mask tent.svg,square,half.png --opacity 0.7",
        "--mask brush --blend translucent",
        "--opacity 0.01",
        "--opacity 1 --blend translucent --mask flower",
    ):
        cells(f"look-{slug(flags)}", flags)


def colours_and_pictures():
    for flags in (
        "--grout auto",
        "--grout none --style mosaic",
        "--grout black",
        "--grout white --grout-width 0.5",
        "--grout 336699 --grout-width 2",
        "--style mosaic --grout-width 0.02",
        "--style mosaic --grout-width 64",
        "--style paint --grout auto",
        "--colors 6",
        "--colors 1",
        "--colors 256",
        "--colors full",
        "--palette three.hex --color-mode pick",
        "--palette three.hex",
        "--palette own.gpl --style mosaic",
        "--palette own.pal --grout auto",
        "--palette few.png",
        "--palette palette.png --style spray",
        "--weight map.png",
        "--weight map.png --style mosaic --candidates 3",
        "--background white",
        "--background black --style paint",
        "--background ff8000 --style mosaic",
        "--color-mode mean",
        "--color-mode pick",
        "--color-mode median",
        "--seed 1",
        "--seed 18446744073709551615",
        "--candidates 2",
        "--candidates 64",
        "--evals 0",
        "--evals 1",
        "--evals 200k --patience 3k",
        "--evals 200k --target-sae 200k",
        "--style mosaic --evals 100k --target-sae 400k",
        "--target-sae 100M",
        "--time 10m",
        "-n 1 --evals 400",
        "-n 2000 --evals 9k",
        "--size 1 -n 3 --evals 60",
        "--size 17 -n 20 --evals 900",
        "--size 200 -n 1k --evals 6k",
        "--threads 1",
        "--threads 2 --size 128",
        "--threads 3",
        "--device cpu",
        "--device auto",
        "--progress json",
        "--progress plain -v",
        "-v",
    ):
        cells(slug(flags), flags)
    for photo in (
        "alpha.png broken_profile.png cmyk.jpg float.tif grey.png grey_16_bit.png linear_grey.png lossless.webp lossy.webp "
        "palette.png plain.jpg progressive.jpg rgb.bmp rgb.png rgb.tif turned.jpg two_frames.gif wide_rgb.jpg wide_rgb.png "
        "woman.jpg photo.png glass.png stripe.png dot.png"
    ).split():
        cells(f"photo-{photo}", "-n 60 --evals 900 --save-target target.png", photo=photo)
        if photo not in ("stripe.png", "dot.png"):
            paper(f"photo-{photo}", "-n 40 --births 300 --save-target target.png", photo=photo)
    for photo in ("alpha.png", "glass.png"):
        for flags in (
            "--background white",
            "--style mosaic --background 204060",
            "--shader soft --mask disc",
            "--grout white",
            "--output-size 150",
            "-o a.svg -o a.ora -o a.jpg -o a.webp",
            "--candidates 3",
        ):
            cells(f"transparent-{photo}-{slug(flags)}", flags, photo=photo)


def going_on():
    first = "smalti evolve parrots.png --size 64 -n 120 --evals 1500 -q -o first.npz"
    for made in (
        "",
        "--style mosaic",
        "--style spray",
        "--mask flower,disc",
        "--opacity 0.5",
        "--background white --grout black",
    ):
        for then in (
            "",
            "--style mosaic",
            "--mask hexagon",
            "--mask disc --opacity 0.4",
            "--background black",
            "--mask flower --shader wash",
            "--shader flat",
        ):
            script = f"""
{first} {made}
smalti evolve parrots.png --size 64 --init first.npz --seed 1 --evals 1500 --json -o a.png -o a.npz {then}
"""
            case(f"init/{slug(made) or 'plain'}-then-{slug(then) or 'plain'}", script)
    case(
        "init/paper-and-cells",
        f"""
{first}
smalti evolve parrots.png --size 64 --scheme paper --init first.npz --births 400 -q -o second.npz -o second.png
smalti evolve parrots.png --size 64 --init second.npz --evals 2k --json -o third.png
smalti evolve parrots.png --size 64 --init second.npz --evals 0 --json -o kept.png
smalti evolve parrots.png --size 64 --init second.npz --palette three.hex --evals 500 --json -o held.png
""",
    )
    case(
        "init/transparent",
        """
smalti evolve alpha.png -n 60 --evals 900 -q -o first.npz
smalti evolve alpha.png --init first.npz --evals 900 --json -o a.png -o a.npz --seed 2
smalti evolve alpha.png --init first.npz --evals 900 --json -o b.png --background white --style mosaic
smalti evolve alpha.png --init first.npz --scheme paper --births 200 --json -o c.png
""",
    )


def outputs():
    for ending in ("png", "jpg", "webp", "svg", "ora", "npz", "csv", "json"):
        line = "smalti evolve parrots.png --size 64 -n 120 --evals 1500 -q --json"
        case(
            f"output/{ending}",
            f"""
{line} -o a.{ending}
{line} -o a.{ending} --threads 2
{line} -o a.{ending} --seed 1
{line} -o a.{ending} --seed 1 --force
echo mine > b.{ending}
{line} -o b.{ending}
{line} -o b.{ending} --force
""",
        )
        case(f"output/mosaic-{ending}", f"{line} --style mosaic -o a.{ending}")
        case(f"output/spray-{ending}", f"{line} --style spray -o a.{ending}")
        case(
            f"output/paper-{ending}",
            f"{line.replace('--evals 1500', '--scheme paper --births 300')} --mask flower -o a.{ending}",
        )
    many = " ".join(f"-o b.{ending}" for ending in ("png", "jpg", "webp", "svg", "ora", "npz", "csv", "json"))
    cells("output-many", many)
    cells("output-many-larger", many + " --output-size 200 --style mosaic")
    for size in (1, 33, 64, 150, 700):
        cells(f"output-size-{size}", f"--output-size {size}")
        cells(f"output-size-{size}-spray", f"--output-size {size} --style spray --mask disc,flower")
        cells(f"output-size-{size}-grout", f"--output-size {size} --style mosaic -o a.jpg -o a.ora")
    case(
        "output/stdout",
        """
smalti evolve parrots.png --size 48 -n 80 --evals 900 -q -o - > out.png
smalti evolve rgb.png -n 50 --evals 900 -q -o - -o b.npz | cat > b.png
""",
    )
    case(
        "output/closed-stdout",
        """
smalti evolve rgb.png -n 50 --evals 900 -q -o - >&-
smalti evolve rgb.png -n 50 --evals 900 -q --json -o a.png > /dev/full
""",
    )
    case(
        "output/full-disk",
        """
ln -s /dev/full full.png
smalti evolve rgb.png -n 50 --evals 900 -q --json -o a.npz -o full.png -o b.png --save-target t.png
""",
    )
    case(
        "output/below-a-folder",
        "mkdir made; smalti evolve rgb.png -n 50 --evals 900 --json -o made/a.png -o ./made/../b.svg",
    )
    case(
        "output/dry-run",
        """
smalti evolve rgb.png --json --dry-run -o a.png --curve c.svg
smalti evolve parrots.png --style paint --dry-run -o b.png; ls
""",
    )
    case(
        "output/dry-run-paper",
        """
smalti evolve rgb.png --preset paper-9 --json --dry-run -o a.png
smalti evolve rgb.png --scheme paper --births 9 --dry-run -o b.png; ls
""",
    )
    keys = "smalti evolve parrots.png --dry-run --json -o a.png"
    case(
        "output/keys",
        "\n".join(
            f"{keys} {flags}"
            for flags in (
                "",
                "--seed 1",
                "--size 40",
                "--output-size 40",
                "--output-size 600",
                "-n 9",
                "--evals 9",
                "--candidates 2",
                "--style mosaic",
                "--preset mosaic",
                "--style paint",
                "--style spray",
                "--grout auto",
                "--grout-width 1",
                "--mask disc",
                "--shader emboss",
                "--opacity 0.5",
                "--blend translucent --mask disc",
                "--color-mode mean",
                "--color-mode median",
                "--colors 9",
                "--palette three.hex",
                "--weight map.png",
                "--background white",
                "--patience 9",
                "--target-sae 9",
                "--time 9",
                "--time 1h30m",
                "--threads 2",
                "--device cpu",
                "--force",
                "--preset own.toml",
                "--preset own.toml -n 30",
                "--preset glaze.toml --blend opaque",
                "--preset strokes.toml",
                "--scheme paper",
                "--scheme paper --batch-births 2",
                "--scheme paper --restarts 1",
                "--preset paper-3",
                "--scheme paper --restarts 1 --cool 0.5",
                "--scheme paper --on-dry stop",
                "--scheme paper --new-blood 0.1",
                "--scheme paper --p-mutation 0.5",
                "--scheme paper --p-crossover 0.5",
                "--scheme paper --no-rotation",
                "--scheme paper --mitosis 1 --restarts 1",
                "--scheme paper --tile-scale 2",
                "--preset paper-9 --restarts 2",
                "--scheme paper --restarts 1 --restart-mask flower,disc",
                "--scheme paper --color-mode pick",
                "--scheme paper --weight map.png",
                "--mask tent.svg",
                "--mask half.png,disc --shader soft",
            )
        )
        + "\n: tent.svg",
    )
    for scheme, flags in (
        ("cells", "--evals 4k"),
        ("mosaic", "--style mosaic --evals 4k --patience 1500"),
        ("paper", "--scheme paper --births 600 --restarts 1"),
    ):
        line = f"smalti evolve parrots.png --size 64 -n 100 {flags} -q --json"
        case(
            f"curve/{scheme}",
            f"{line} -o a.png --curve a.csv --curve a.svg\n{line} -o a.png --curve a.csv --curve notes.csv",
        )
        case(
            f"save-run/{scheme}",
            f"""
{line} -o a.png --save-run run
{line} -o a.png --save-run run
{line} -o b.png --seed 4 --save-run run
""",
        )
        case(
            f"save-run/{scheme}-every",
            f"{line} -o a.png -o a.npz --save-run run --save-every 500\n"
            f"last=$(ls run/*.npz | tail -1); first=$(ls run/*.npz | head -1)\n"
            f"""
smalti render $first -o first.png -q
smalti evolve parrots.png --size 64 --init $last --evals 600 --json -o b.png
""",
        )


def papers_scheme():
    for number in range(1, 13):
        paper(f"preset-{number}", f"--preset paper-{number}")
        case(
            f"paper/preset-{number}-as-it-is",
            f"smalti evolve photo.png --preset paper-{number} --births 150 --batch-births 10 --json -o a.png -o a.npz",
        )
    for flags in (
        "",
        "--seed 5",
        "--births 0",
        "--births 100",
        "--births 4k -n 60",
        "--restarts 2",
        "--restarts 3 --cool 0.5",
        "--restarts 1 --cool 0.00001",
        "--on-dry fallback",
        "--on-dry restart --restarts 2 --births 5k -n 30",
        "--on-dry stop --births 5k -n 30",
        "--p-mutation 0.5",
        "--p-mutation 0 --p-crossover 1",
        "--p-crossover 0.25",
        "--new-blood 0.1",
        "--new-blood 1",
        "--mitosis 2 --restarts 2",
        "--mitosis 1 --restarts 3 --restart-mask flower",
        "--mitosis 5 --restarts 5 --births 200",
        "--no-rotation",
        "--no-rotation --mask border --p-crossover 0.5",
        "--tile-scale 0.3",
        "--tile-scale 3",
        "--batch-births 1",
        "--batch-births 16",
        "--batch-births 100",
        "--restarts 1 --restart-mask border,lines",
        "--restarts 2 --restart-mask tent.svg --mask disc --cool 0.7",
        "--color-mode evolved",
        "--color-mode pick",
        "--color-mode mean",
        "--color-mode median",
        "--colors 7",
        "--palette three.hex",
        "--palette own.gpl --color-mode pick",
        "--mask flower",
        "--mask half.png,disc",
        "--mask disc --shader soft --color-mode mean --tile-scale 2",
        "--shader wash --mask hexagon",
        "--opacity 0.5",
        "--opacity 0.3 --mask brush --batch-births 8",
        "--blend translucent --mask flower",
        "--blend opaque --shader soft --mask disc",
        "--background white",
        "--background 204060",
        "--patience 50 --births 50k",
        "--patience 50 --births 50k --restarts 2",
        "--target-sae 900k --births 50k",
        "--target-sae 100M --restarts 2",
        "--target-sae 100M --restarts 2 --mitosis 2",
        "--time 10m",
        "--threads 2",
        "--threads 2 --size 200 -n 800 --batch-births 64",
        "--output-size 150 -o a.svg -o a.ora -o a.csv -o a.json",
        "--preset paper-9 --restarts 2 --restart-mask disc",
        "--preset paper-2 --colors full --mask triangle",
        "--preset paper-5 --births 300 --p-crossover 0.5 --cool 0.5 --restarts 1",
        "--progress json -v",
    ):
        paper(slug(flags) or "plain", flags)
    first = "smalti evolve parrots.png --size 64 --scheme paper -n 100 --births 500 -q -o first.npz"
    for made, then in (
        ("", ""),
        ("--mask disc", ""),
        ("--mask disc", "--mask square"),
        ("--mask disc", "--shader emboss"),
        ("--mask disc", "--opacity 0.5"),
        ("--mask disc", "--restarts 1 --restart-mask flower,square"),
        ("--opacity 0.4", ""),
        ("--mask flower,brush", "--color-mode pick"),
        ("", "-n 60"),
        ("--background white", "--restarts 1 --cool 0.5"),
        ("--no-rotation", "--no-rotation"),
    ):
        script = f"""
{first} {made}
smalti evolve parrots.png --size 64 --scheme paper --init first.npz --births 500 --seed 1 --json -o a.png -o a.npz {then}
"""
        case(f"paper/init-{slug(made) or 'plain'}-then-{slug(then) or 'plain'}", script)


def presets_and_configuration():
    for preset in ("own.toml", "strokes.toml", "glaze.toml", "ends.toml"):
        size = "--size 64 -n 90 --evals 2k" if preset == "glaze.toml" else ""
        tent = "\n: tent.svg"
        for flags in (
            "",
            "-n 50",
            "--evals 900",
            "--size 40",
            "--grout white",
            "--grout none",
            "--mask triangle",
            "--opacity 0.5",
            "--shader flat",
            "--background white",
            "--color-mode pick",
            "--candidates 3",
            "--colors 5",
            "--seed 9",
            "--blend opaque",
            "--weight map.png",
            "--palette three.hex",
            "--style free",
            "--scheme paper",
        ):
            if size and re.match(r"-n|--evals|--size", flags):
                continue
            case(
                f"preset/{preset}-{slug(flags) or 'alone'}",
                f"smalti evolve parrots.png {size} --preset {preset} --json -o a.png -o a.npz {flags}{tent}",
            )
    for number, text in enumerate(
        (
            'style = "cubist"',
            "evals = 9\\nsize = 64\\ntilez = 3",
            'evals = "many"',
            "overlap = -1",
            "side = [0.5, 99]",
            "side = [2, 1]",
            'guide = "north"',
            'grout = "red"',
            "style = mosaic",
            "[[classes]]\\nshare = 0.5",
            "[[classes]]\\nshare = 0.5\\nscale = 9",
            "hole = 1001",
            "tiles = 0",
            "candidates = 99",
            "opacity = 0",
            'blend = "opaque"\\nopacity = 0.5',
            'grout = "none"\\ngrout-width = 0.1',
            'masks = ["none.svg"]',
            "coherence = 256",
            "recolor = 1.5",
        )
    ):
        case(
            f"preset/wrong-{number:02}",
            f"printf '{text}\\n' > wrong.toml\nsmalti evolve photo.png -o a.png --json --preset wrong.toml",
        )
    bare = "unset SMALTI_DEVICE SMALTI_THREADS SMALTI_PROGRESS\n"
    case("config/evolve", f"{bare}smalti evolve parrots.png --config flags.toml --json")
    case("config/before-the-command", f"{bare}smalti --config flags.toml evolve parrots.png --json -o a.png")
    case(
        "config/flags-go-first",
        f"{bare}smalti evolve parrots.png --config flags.toml --json -o a.png --style paint --mask brush -n 60 --size 48",
    )
    case(
        "config/environment",
        f"""
{bare}export SMALTI_CONFIG=flags.toml
smalti evolve parrots.png --json -o a.png --evals 900
smalti evolve parrots.png --json -o b.png --scheme paper --births 100
""",
    )
    case("config/environment-empty", "SMALTI_CONFIG= smalti evolve rgb.png -n 30 --evals 500 --json -o a.png")
    case(
        "config/paper",
        f"""
{bare}printf 'scheme = \"paper\"\\nbirths = 300\\nno-rotation = true\\nrestarts = 1\\ncool = 0.5\\nsize = 48\\ntiles = 50\\n' > c.toml
smalti evolve parrots.png --config c.toml --json -o a.png -o a.npz
smalti score --config c.toml a.png a.png
""",
    )
    case(
        "config/batch",
        f"""
{bare}mkdir in; mv rgb.png alpha.png in
smalti batch in -o out --config flags.toml --json
smalti batch in -o other --config flags.toml --style mosaic --format png
""",
        unordered=True,
    )
    case(
        "config/plan", f"{bare}mkdir in; mv rgb.png alpha.png in\nsmalti plan in -o out --config flags.toml --shards 2"
    )
    case(
        "config/render-and-score",
        f"""
{bare}smalti evolve rgb.png -n 40 --evals 600 -q -o a.npz -o a.png --save-target t.png
smalti render a.npz -o b.png --config flags.toml --json
smalti score t.png a.png --config flags.toml
""",
    )
    for number, text in enumerate(
        (
            "tilez = 3",
            '[evolve]\\nevals = "many"',
            "[nothing]\\nsize = 3",
            "size = ",
            "json = 3",
            'config = "x.toml"',
            "[evolve]\\nno-rotation = false\\nforce = false",
            "threads = [1, 2]",
        )
    ):
        case(
            f"config/wrong-{number}",
            f"""
{bare}printf '{text}\\n' > wrong.toml
smalti evolve photo.png -n 30 --evals 300 -o a.png --json --config wrong.toml
""",
        )
    case(
        "config/missing", "smalti evolve photo.png -o a.png --config none.toml; SMALTI_CONFIG=none.toml smalti devices"
    )
    line = "smalti evolve rgb.png -n 40 --evals 600 --json"
    case(
        "environment/device",
        f"""
SMALTI_DEVICE=cpu {line} -o a.png
SMALTI_DEVICE= {line} -o b.png
SMALTI_DEVICE=name:nothing {line} -o c.png
SMALTI_DEVICE=name:nothing {line} -o d.png --device cpu
SMALTI_DEVICE=gpu {line} -o e.png
""",
    )
    case(
        "environment/threads",
        f"""
SMALTI_THREADS=2 {line} -o a.png
SMALTI_THREADS= {line} -o b.png
SMALTI_THREADS=0 {line} -o c.png
SMALTI_THREADS=0 {line} -o d.png --threads 1
""",
    )
    case("environment/progress", f"SMALTI_PROGRESS=json {line} -o a.png; SMALTI_PROGRESS=never {line} -o b.png")


FOLDER = "mkdir -p in/sub; mv rgb.png alpha.png plain.jpg in; mv lossy.webp in/sub\n"
FEW = "-n 40 --evals 700"


def batches():
    for name, flags in (
        ("plain", ""),
        ("recursive", "--recursive"),
        ("two-threads", "--threads 2"),
        ("in-flight", "--in-flight 2 --io-threads 2:2 --threads 2"),
        ("formats", "--format png,npz,svg,csv,json,jpg,webp,ora"),
        ("names", "--recursive --name {index}-{dir}-{stem}-{seed}-{suffix}.{ext} --seed 7"),
        ("names-id", "--recursive --name {id}.{ext}"),
        ("mosaic", "--style mosaic --size 40"),
        ("spray", "--style spray --candidates 2"),
        ("larger", "--output-size 100 --format jpg"),
        ("preset", "--preset strokes.toml"),
        ("palette", "--palette three.hex --grout auto"),
        ("masks", "--mask tent.svg,disc --shader emboss"),
        ("dry-run", "--dry-run"),
        ("results", "--results rows.jsonl"),
        ("devices", "--devices cpu"),
        ("two-devices", "--devices cpu,cpu"),
        ("trace", "--trace trace.json"),
        ("background", "--background white"),
        ("ends", "--patience 300 --target-sae 20k"),
    ):
        few = "" if name == "preset" else FEW
        case(
            f"batch/{name}",
            f"{FOLDER}smalti batch in -o out {few} --json {flags}",
            unordered=True,
            exists=("trace.json",),
        )
    scheme = "--scheme paper -n 30 --births 300"
    for name, flags in (
        ("plain", ""),
        ("threads", "--threads 2"),
        ("batch-births", "--batch-births 5 --restarts 1 --cool 0.5"),
        ("preset", "--preset paper-9"),
        ("odd", "--mitosis 1 --restarts 1 --new-blood 0.1 --no-rotation"),
    ):
        case(
            f"batch/paper-{name}",
            f"{FOLDER}smalti batch in -o out {scheme} --format png,npz --json {flags}",
            unordered=True,
        )
    case(
        "batch/patterns",
        f"{FOLDER}smalti batch 'in/*.png' 'in/**/*.webp' in/plain.jpg -o out {FEW} --json",
        unordered=True,
    )
    case(
        "batch/inside",
        f"""
{FOLDER}smalti batch in --recursive -o in/mosaics {FEW} --json
smalti batch in --recursive -o in/mosaics {FEW} --json
""",
        unordered=True,
    )
    manifest = ": rgb.png plain.jpg alpha.png grey.png lossy.webp\n"
    case(
        "batch/manifest",
        f"{manifest}smalti batch --manifest work.jsonl -o out -n 40 --format png,npz --json",
        unordered=True,
    )
    case(
        "batch/manifest-stdin", f"{manifest}smalti batch --manifest - -o out -n 40 --json < work.jsonl", unordered=True
    )
    case(
        "batch/manifest-shards",
        f"""
{manifest}for k in 1 2 3; do smalti batch --manifest work.jsonl -o out -n 40 --shard $k/3 --json; done
smalti merge out -o all.csv --manifest work.jsonl
smalti merge out -o all.jsonl
""",
        unordered=True,
    )
    case(
        "batch/manifest-dry-run",
        f"""
{manifest}smalti batch --manifest work.jsonl -o out -n 40 --dry-run --json
smalti batch --manifest work.jsonl -o out -n 40 --dry-run --shard 2/3
""",
        unordered=True,
    )
    case(
        "batch/chain",
        f"""
: rgb.png plain.jpg alpha.png
smalti batch --manifest chain.jsonl -o out --name {{id}}.{{ext}} {FEW} --json
smalti batch --manifest chain.jsonl -o out --name {{id}}.{{ext}} {FEW} --json
smalti merge out -o all.csv --manifest chain.jsonl
""",
        unordered=True,
    )
    case(
        "batch/again",
        f"""
{FOLDER}smalti batch in -o out {FEW} --format png,npz --json
rm out/rgb.png; head -c 900 out/alpha.npz > cut; mv cut out/alpha.npz
smalti batch in -o out {FEW} --format png,npz --json
smalti batch in -o out {FEW} --format png,npz --json
""",
        unordered=True,
    )
    for how in ("skip-same", "skip", "overwrite", "error"):
        case(
            f"batch/on-exists-{how}",
            f"""
{FOLDER}smalti batch in -o out {FEW} -q
echo mine > out/rgb.png; head -c 500 out/alpha.png > cut; mv cut out/alpha.png
"""
            f"""
smalti batch in -o out {FEW} --json --on-exists {how}
smalti batch in -o out {FEW} --seed 1 --json --on-exists {how}
""",
            unordered=True,
        )
    case(
        "batch/bad-pictures",
        f"""
{FOLDER}cp bad.png in; head -c 300 in/rgb.png > in/cut.png; : > in/empty.jpg; mkdir in/folder.png
smalti batch in none.png -o out {FEW} --json
smalti batch in none.png -o out {FEW} --json
smalti merge out -o all.csv
""",
        unordered=True,
    )
    case(
        "batch/odd-names",
        f"""
mkdir in; mv rgb.png 'in/a b.png'; mv plain.jpg $'in/\\xff.jpg'; mv alpha.png in/.hidden.png; mv grey.png in/-x.png
smalti batch in -o out {FEW} --json
""",
        unordered=True,
    )
    case(
        "batch/init-and-weight",
        f"""
mkdir in; mv rgb.png in
smalti evolve in/rgb.png {FEW} -q -o p.npz
smalti batch in -o out --init p.npz --evals 500 --seed 3 --json
smalti batch in -o weighed --weight in/rgb.png {FEW} --json
""",
        unordered=True,
    )
    case(
        "batch/shard-auto",
        f"""
{FOLDER}SHARD_INDEX=1 SHARD_COUNT=2 smalti batch in -o out {FEW} --shard auto --json
JOB_COMPLETION_INDEX=1 SHARD_COUNT=2 smalti batch in -o out {FEW} --shard auto --json
SLURM_ARRAY_TASK_ID=2 SLURM_ARRAY_TASK_MIN=0 SLURM_ARRAY_TASK_MAX=2 SLURM_ARRAY_TASK_STEP=1 SLURM_ARRAY_TASK_COUNT=3 smalti batch in -o out {FEW} --shard auto --json
smalti batch in -o out {FEW} --shard auto
""",
        unordered=True,
    )
    case(
        "batch/shard-empty",
        f"""
{FOLDER}smalti batch in -o out {FEW} --shard 9/9 --json
smalti batch in -o out {FEW} --shard 1/9 --json
""",
        unordered=True,
    )
    case(
        "batch/with-evolve",
        f"""
{FOLDER}smalti batch in -o out {FEW} --style mosaic -q
smalti evolve in/rgb.png {FEW} --style mosaic -q -o rgb.png; cmp rgb.png out/rgb.png && echo same
""",
    )
    for name, line in (
        ("nothing", "-o out"),
        ("no-match", "'none/*.png' -o out"),
        ("twice", "in ./in/rgb.png -o out -n 40 --evals 300"),
        ("over-inputs", "in -o in --format png"),
        ("circle", "--manifest circle.jsonl -o out"),
        ("weird", "--manifest weird.jsonl -o out"),
        ("torn", "--manifest torn.jsonl -o out"),
        ("no-manifest", "--manifest none.jsonl -o out"),
        ("gif", "in -o out --format gif"),
        ("format-twice", "in -o out --format png,.PNG"),
        ("name", "in -o out --name {stem}.png"),
        ("name-field", "in -o out --name {what}.{ext}"),
        ("shard", "in -o out --shard 3/2"),
        ("in-flight", "in -o out --in-flight 0"),
        ("io-threads", "in -o out --io-threads 0:1"),
        ("results", "in -o out --results -"),
        ("results-input", "in -o out --results in/rgb.png"),
        ("devices", "in -o out --devices cpu --device cpu"),
        ("no-device", "in -o out --devices name:nothing"),
        ("time", "in -o out --time soon"),
        ("tiles", "in -o out -n 0"),
        ("diary", "in -o out --results notes.csv"),
        ("out-is-file", "in -o notes.csv"),
        ("trace-input", "in -o out --trace in/rgb.png"),
    ):
        case(f"batch/refused-{name}", f"{FOLDER}smalti batch {line}\n: rgb.png")


def plans_and_merges():
    for name, flags in (
        ("shards", "--shards 2"),
        ("per-shard", "--per-shard 2"),
        ("minutes", "--minutes 1 --picture-time 30s"),
        ("into", "--shards 3 --into p/lan --picture-time 500ms"),
        (
            "flags",
            "--shards 2 --style mosaic --grout white --mask disc,tent.svg --opacity 1 --colors 9 --seed 4 --format png,npz --output-size 90 --candidates 2",
        ),
        (
            "paper",
            "--shards 1 --scheme paper --births 300 --restarts 1 --cool 0.5 --no-rotation --restart-mask flower --color-mode pick",
        ),
        ("recursive", "--shards 2 --recursive --name {dir}/x-{stem}.{ext} --on-exists overwrite"),
        ("device", "--shards 2 --device cpu --threads 3"),
        ("preset", "--shards 2 --preset strokes.toml"),
        ("files", "--shards 2 --palette three.hex --weight map.png"),
        ("many", "--shards 9"),
        ("dry-run", "--shards 2 --dry-run --json"),
    ):
        guess = "" if "picture-time" in flags else "--picture-time 4s"
        case(f"plan/{name}", f"{FOLDER}smalti plan in -o out {guess} {flags}\n: tent.svg", unordered=True)
    case(
        "plan/manifest",
        """
: rgb.png plain.jpg alpha.png grey.png lossy.webp
smalti plan --manifest work.jsonl -o out --shards 3 --picture-time 2s
smalti plan --manifest - -o out --shards 2 --picture-time 2s --into other < work.jsonl
""",
    )
    case(
        "plan/run",
        f"""{FOLDER}
smalti plan in -o out --recursive --shards 2 --picture-time 2s {FEW}
for k in 1 2; do smalti batch --manifest plan/shard-000$k.jsonl -o out --results out/results.$k-of-2.jsonl {FEW}; done
smalti merge out -o all.csv --manifest plan/manifest.jsonl
sh plan/parallel.sh --shard 2; echo "exit $?"
bash -n plan/submit.slurm && echo readable
""",
    )
    case(
        "plan/again",
        f"""{FOLDER}
smalti plan in -o out --shards 2 --picture-time 2s; echo "exit $?"
smalti plan in -o out --shards 3 --picture-time 2s
echo "# mine" >> plan/submit.slurm
smalti plan in -o out --shards 1 --picture-time 2s
smalti plan in -o out --shards 1 --picture-time 2s --force
""",
    )
    for name, flags in (
        ("no-count", ""),
        ("zero", "--shards 0"),
        ("minutes", "--minutes 0"),
        ("shard", "--shards 2 --shard 1/2"),
        ("results", "--shards 2 --results r.jsonl"),
        ("trace", "--shards 2 --trace t.json"),
        ("picture-time", "--shards 2 --picture-time soon"),
        ("two-counts", "--shards 2 --per-shard 3"),
    ):
        case(f"plan/refused-{name}", f"{FOLDER}smalti plan in -o out {flags}")
    rows = f"""
{FOLDER}cp bad.png in
smalti batch in -o out {FEW} -q
smalti batch in/rgb.png in/bad.png none.png -o other {FEW} --seed 2 -q
"""
    case(
        "merge/formats",
        f"""
{rows}smalti merge out -o all.jsonl
smalti merge out -o all.csv
smalti merge out -o all.txt --format csv
smalti merge out -o - > stdout.jsonl
smalti merge out -o - --format csv --quiet > stdout.csv
""",
    )
    case("merge/several", f"{rows}smalti merge out other/results.jsonl -o all.jsonl; smalti merge other out -o all.csv")
    case(
        "merge/manifest",
        f"""
{rows}printf '{{\"input\": \"in/rgb.png\"}}\\n{{\"input\": \"in/late.png\"}}\\n' > want.jsonl
smalti merge out -o all.csv --manifest want.jsonl
smalti merge other -o all.jsonl --manifest want.jsonl --manifest want.jsonl
""",
    )
    case("merge/torn", f'{rows}printf \'{{"id":"a\' >> out/results.jsonl; smalti merge out -o all.jsonl')
    case(
        "merge/again",
        f"""
{rows}smalti merge out -o out/results-all.jsonl
smalti merge out -o out/results-all.jsonl
smalti merge out -o out/results.jsonl
smalti merge out -o notes.csv
smalti merge out -o notes.csv --force
smalti merge out -o in/rgb.png
smalti merge none.jsonl -o new.jsonl
smalti merge in/rgb.png -o new.jsonl
smalti merge out -o missing/new.csv
""",
    )


def renders():
    for name, made in (
        ("free", "--style free"),
        ("mosaic", "--style mosaic"),
        ("paint", "--style paint"),
        ("spray", "--style spray"),
        ("paper", "--scheme paper --births 500 --mask flower"),
        ("glass", "--opacity 0.5 --mask hexagon"),
        ("alpha", "--mask disc --grout white"),
    ):
        photo = "alpha.png" if name == "alpha" else "parrots.png"
        evals = "" if "births" in made else "--evals 1500"
        first = f"smalti evolve {photo} --size 64 -n 100 {evals} -q -o p.npz {made}\n"
        case(
            f"render/{name}-formats",
            first
            + "smalti render p.npz --json "
            + " ".join(f"-o a.{e}" for e in ("png", "jpg", "webp", "svg", "ora", "npz", "csv", "json")),
        )
        case(
            f"render/{name}-sizes",
            first
            + "for size in 1 31 64 100 333; do smalti render p.npz --json -o $size.png -o $size.svg -o $size.ora --output-size $size; done",
        )
        case(
            f"render/{name}-masks",
            first
            + "\n".join(f"smalti render p.npz -q -o {mask}.png -o {mask}.npz --mask {mask}" for mask in MASKS)
            + "\nsmalti render p.npz --json -o t.png --mask tent.svg,disc --output-size 120",
        )
        case(
            f"render/{name}-shaders",
            first
            + "\n".join(
                f"smalti render p.npz -q -o {shader}.png -o {shader}.svg --mask disc,lines --shader {shader}"
                for shader in SHADERS
            )
            + "\nsmalti render p.npz -q -o only.png --shader emboss",
        )
        case(
            f"render/{name}-looks",
            first
            + "\n".join(
                f"smalti render p.npz --json -o {number}.png -o {number}.ora {flags}"
                for number, flags in enumerate(
                    (
                        "--background white",
                        "--background 336699 --output-size 100",
                        "--supersample 1",
                        "--supersample 16 --output-size 90",
                        "--supersample 3",
                        "--mask disc --opacity 0.5",
                        "--blend translucent --mask disc",
                        "--blend opaque",
                        "--mask flower --opacity 0.2 --output-size 130 --background black",
                        "--threads 2 --output-size 200",
                    )
                )
            ),
        )
    first = "smalti evolve photo.png -n 30 --evals 500 -q -o p.npz\n"
    case(
        "render/stdout",
        first + """
smalti render p.npz -o - > a.png
smalti render p.npz -o - --output-size 77 -q > b.png
smalti render p.npz -o - --json
""",
    )
    case(
        "render/force",
        first + """
smalti render p.npz -o a.png
smalti render p.npz -o a.png --output-size 40
smalti render p.npz -o a.png --background white
smalti render p.npz -o a.png --background white --force
smalti render p.npz -o notes.csv
smalti render p.npz -o p.npz
""",
    )
    case(
        "render/bad",
        first + """
head -c 700 p.npz > cut.npz
for bad in cut.npz none.npz bad.png photo.png; do smalti render $bad -o b.png --json; done
""",
    )
    for name, flags in (
        ("no-output", ""),
        ("size", "-o a.npz -o a.csv --output-size 80"),
        ("svg-supersample", "-o a.svg --supersample 2"),
        ("supersample-0", "-o a.png --supersample 0"),
        ("supersample-17", "-o a.png --supersample 17"),
        ("output-size", "-o a.png --output-size 65536"),
        ("background", "-o a.png --background red"),
        ("quiet-verbose", "-o a.png -q -v"),
        ("gif", "-o a.gif"),
    ):
        case(f"render/refused-{name}", f"{first}smalti render p.npz {flags}")


def animations():
    for name, flags in (
        ("cells", "--style mosaic --evals 6k"),
        ("spray", "--style spray --evals 4k"),
        ("paper", "--scheme paper --births 600 --restarts 1 --restart-mask disc"),
    ):
        first = f"smalti evolve parrots.png --size 48 -n 80 {flags} -q -o m.png --save-run run\n"
        case(f"timelapse/{name}", first + "smalti timelapse run -o a.gif -o a.png -o a.apng --frames 12")
        for rest in (
            "--spacing births",
            "--spacing error --frames 5",
            "--spacing snapshots --frames 7",
            "--frames 1 --hold 0",
            "--fps 50 --hold 3 --loop 2 --frames 4",
            "--output-size 90 --background white --frames 4",
            "--threads 2 --frames 6",
        ):
            case(f"timelapse/{name}-{slug(rest)}", f"{first}smalti timelapse run -o a.gif -o a.png {rest}")
        case(f"timelapse/{name}-video", f"{first}smalti timelapse run -o a.mp4 -o a.webm --frames 6", needs=("ffmpeg",))
    first = "smalti evolve photo.png -n 30 --evals 900 -q -o m.png --save-run run\n"
    case(
        "timelapse/force",
        first + """
smalti timelapse run -o a.gif --frames 3
smalti timelapse run -o a.gif --frames 4
smalti timelapse run -o a.gif --frames 4 --force
smalti timelapse run -o m.png; echo x > b.gif
smalti timelapse run -o b.gif
""",
    )
    for name, flags in (
        ("fps", "-o t.gif --fps 60"),
        ("fps-0", "-o t.png --fps 0"),
        ("hold", "-o t.png --hold 601"),
        ("frames", "-o t.png --frames 0"),
        ("ending", "-o t.tif"),
        ("no-output", ""),
    ):
        case(f"timelapse/refused-{name}", f"{first}smalti timelapse run {flags}")
    case(
        "timelapse/refused-folder",
        """
mkdir empty
smalti timelapse empty -o a.gif
smalti timelapse none -o a.gif
smalti timelapse photo.png -o a.gif
""",
    )
    few = "-n 60 --evals 1500"
    for name, flags in (
        ("plain", ""),
        ("cold", "--warm-start off"),
        ("warm-evals", "--warm-evals 900"),
        ("keyframes", "--keyframe-every 2"),
        ("no-cuts", "--scene-cut off"),
        ("noise", "--noise 2"),
        ("noise-0", "--noise 0"),
        ("move-4", "--max-tile-move 4"),
        ("move-small", "--max-tile-move 0.5"),
        ("mosaic", "--style mosaic"),
        ("paint", "--style paint"),
        ("spray", "--style spray"),
        ("spray-move", "--style spray --max-tile-move 2"),
        ("larger", "--output-size 90"),
        ("jpg", "--format jpg"),
        ("webp", "--format webp"),
        ("seed", "--seed 5"),
        ("threads", "--threads 2"),
        ("palette", "--palette three.hex"),
        ("masks", "--mask disc,tent.svg --opacity 0.7"),
        ("part", "--frames 1..3"),
        ("candidates", "--candidates 3"),
        ("mean", "--color-mode mean"),
        ("trace", "--trace trace.json"),
        ("smaller", "--size 30"),
        ("grout", "--grout white --mask hexagon"),
        ("weight", "--weight clip/f0.png"),
    ):
        case(f"video/{name}", f"smalti video clip {few} -o out --json {flags}\n: tent.svg", exists=("trace.json",))
    for name, flags in (
        ("cuts", ""),
        ("cuts-mosaic", "--style mosaic"),
        ("cuts-move", "--max-tile-move 2"),
        ("cuts-keyframes", "--keyframe-every 2"),
    ):
        case(
            f"video/{name}",
            f"""
smalti video cuts {few} -o out --json {flags}
smalti score --flicker cuts out
smalti score --flicker cuts out --json --still 30
""",
        )
    case(
        "video/shots",
        """
smalti video cuts --shots
smalti video cuts --shots --json
smalti video cuts --shots --json --scene-cut off --keyframe-every 4
smalti video cuts --shots --json --scene-cut 5
""",
    )
    case(
        "video/in-parts",
        f"""
smalti video cuts {few} -o whole -q
smalti video cuts {few} -o parts -q --frames 3..6
smalti video cuts {few} -o parts -q --frames 0..3; cd parts
for f in *.png; do cmp $f ../whole/$f && echo same; done
""",
    )
    case(
        "video/again",
        f"""
smalti video clip {few} -o out --json; rm out/*1.png
smalti video clip {few} -o out --json
smalti video clip {few} -o out --json
smalti video clip {few} -o out --seed 1 --json
smalti video clip {few} -o out --seed 1 --json --force
""",
    )
    case("video/animations", f"smalti video clip {few} -o a.gif -o a.png -o a.apng --fps 10 --json")
    case(
        "video/folder-and-gif",
        f"smalti video clip/f0.png clip/f1.png clip/f2.png {few} -o out -o a.gif --populations kept --json",
    )
    case(
        "video/transparent",
        f"mkdir in; cp alpha.png in/1.png; cp alpha.png in/2.png; smalti video in {few} -o out --json",
    )
    case("video/films", f"smalti video clip {few} -o a.mp4 -o a.webm --fps 10 --json", needs=("ffmpeg",))
    case(
        "video/from-film",
        f"""
ffmpeg -v error -i clip/f%d.png -c:v ffv1 -flags:v +bitexact -fflags +bitexact clip.mkv
smalti video clip.mkv {few} -o out -o b.gif --json
smalti video clip.mkv {few} -o out -o b.gif --json
smalti video clip.mkv --shots --json
""",
        needs=("ffmpeg",),
    )
    for name, line in (
        ("sizes", "odd -o out"),
        ("frames", "clip -o out --frames 2..9"),
        ("no-frames", "clip -o out --frames 2..2"),
        ("time", "clip -o out --time 1s"),
        ("paper", "clip -o out --scheme paper"),
        ("move", "clip -o out --max-tile-move 0"),
        ("cut", "clip -o out --scene-cut 300"),
        ("onto", "clip -o clip"),
        ("two-folders", "clip -o out -o other"),
        ("ending", "clip -o out.tif"),
        ("none", "none -o out"),
        ("no-output", "clip"),
        ("init", "clip -o out --init x.npz"),
        ("noise", "clip -o out --noise 64"),
        ("bad", "bad.png -o out"),
    ):
        case(f"video/refused-{name}", f"smalti video {line} {few}")


def measures_pages_and_texts():
    first = """
smalti evolve parrots.png --size 64 -n 100 --evals 1500 -q -o a.png -o a.jpg -o a.webp --save-target t.png
smalti evolve parrots.png --size 64 -n 60 --evals 900 -q -o b.png --style mosaic
"""
    case("score/table", first + "smalti score t.png a.png b.png a.jpg a.webp t.png")
    case(
        "score/json",
        first + """
smalti score t.png a.png b.png --json
smalti score t.png none.png a.png --json
smalti score t.png none.png
smalti score t.png photo.png
smalti score dot.png dot.png
""",
    )
    case(
        "score/background",
        """
for b in black white ff8000; do smalti score alpha.png rgb.png --background $b
smalti score glass.png glass.png --background $b --json; done
""",
    )
    case(
        "score/photos",
        "smalti score rgb.png rgb.bmp rgb.tif plain.jpg lossless.webp lossy.webp grey.png grey_16_bit.png wide_rgb.png cmyk.jpg float.tif palette.png progressive.jpg turned.jpg two_frames.gif --json",
    )
    case(
        "score/flicker",
        """
smalti score --flicker clip clip
smalti score --flicker clip cuts
smalti score --flicker cuts cuts --json --still 0
smalti score --flicker clip none
smalti score --flicker clip photo.png
""",
    )
    case(
        "score/refused",
        """
smalti score photo.png
smalti score photo.png photo.png --background red
smalti score bad.png photo.png
smalti score photo.png photo.png --still 300 --flicker
""",
    )
    case("gallery/small", "smalti gallery photo.png -o gallery --births 2")
    case(
        "gallery/refused",
        """
mkdir mine; echo x > mine/x.txt
smalti gallery photo.png -o mine --births 0
smalti gallery photo.png -o photo.png
smalti gallery none.png -o g
smalti gallery -o g
""",
    )
    album = "mkdir photos; mv rgb.png alpha.png photos\n"
    for name in ("table1", "table2", "fig3", "fig5", "fig6"):
        images = "" if name.startswith("table") else "--images photos"
        case(f"figures/{name}", f"{album}smalti paper {name} {images} -o figures --births 60 --seed 2")
    case("figures/all", f"{album}rm photos/alpha.png; smalti paper all --images photos -o figures --births 10")
    case(
        "figures/again",
        f"""
{album}smalti paper fig3 --images photos -o figures -q
smalti paper table1 -o figures -q; echo mine > figures/x.txt
smalti paper table2 -o figures -q
""",
    )
    case(
        "figures/refused",
        f"""{album}mkdir empty broken; cp bad.png broken
smalti paper fig4 -o out; smalti paper fig4 --images missing -o out; smalti paper fig4 --images empty -o out; smalti paper fig4 --images broken -o out
smalti paper table1 -o bad.png; smalti paper table1 -o photos; smalti paper table1 -o photos --force; smalti paper fig10 -o out; smalti paper fig3 --images photos -o out --births many
""",
    )
    case("devices/table", "smalti devices")
    case("devices/json", "smalti devices --json")
    case("texts/version", "smalti --version; smalti -V")
    for shell in ("bash", "zsh", "fish", "elvish", "powershell"):
        case(f"completions/{shell}", f"smalti completions {shell}", words=shell != "bash")
    case("completions/refused", "smalti completions tcsh; smalti completions")
    case("texts/help", "smalti; smalti --help; smalti -h; smalti help; smalti help nothing", words=True)
    for command in (
        "evolve",
        "batch",
        "video",
        "render",
        "paper",
        "gallery",
        "timelapse",
        "devices",
        "score",
        "plan",
        "merge",
        "bench",
        "completions",
        "man",
    ):
        case(
            f"texts/help-{command}",
            f"smalti {command} --help; smalti {command} -h; smalti help {command}; smalti man {command}",
            words=True,
        )
    case("texts/man", "smalti man; smalti man -o pages; smalti man -o a/b/c; smalti man nothing", words=True)


def refusals():
    for flags in (
        "-n 0",
        "-n 1000001",
        "-n many",
        "-n -3",
        "--size 0",
        "--size 65536",
        "--output-size 0",
        "--births 1.5",
        "--batch-births 0",
        "-n 60 --batch-births 61",
        "--cool 0.5",
        "--cool 0 --restarts 1",
        "--cool 1.5 --restarts 1",
        "--cool NaN --restarts 1",
        "--patience 0",
        "--time soon",
        "--background red",
        "--threads 0",
        "--scheme quick",
        "--device gpu",
        "--validate --device cpu",
        "--sed 1",
        "-q -v",
        "--p-mutation 1.5",
        "--p-crossover=-0.1",
        "--new-blood 2",
        "--new-blood much",
        "--mitosis 21 --restarts 30",
        "--mitosis 2 --restarts 1",
        "--mitosis 2",
        "-n 60 --mitosis 6 --restarts 6",
        "-n 60 --mitosis 2 --restarts 2 --batch-births 16",
        "--tile-scale 0.05",
        "--tile-scale inf",
        "--color-mode blue",
        "--curve curve.png",
        "--curve a.csv --curve ./a.csv",
        "--curve missing/a.csv",
        "--restart-mask disc",
        "--evals 9",
        "--style mosaic",
        "--candidates 2",
        "--grout auto",
        "--weight photo.png",
        "--preset mosaic",
        "--preset paper-13",
        "--on-dry never",
    ):
        case(f"refused/paper-{slug(flags)}", f"smalti evolve photo.png --scheme paper -o out.png --json {flags}")
    for flags in (
        "--births 9",
        "--batch-births 2",
        "--restarts 1",
        "--cool 0.5",
        "--no-rotation",
        "--tile-scale 1",
        "--preset paper-3 --scheme cells",
        "--candidates 0",
        "--candidates 65",
        "--evals many",
        "--patience 0",
        "--style cubist",
        "--preset cubist",
        "--preset mosaic --style free",
        "--preset none.toml",
        "--grout red",
        "--grout-width 0",
        "--grout-width 65",
        "--grout none --grout-width 1",
        "--blend translucent --mask disc --grout black",
        "--style mosaic --shader soft --grout-width 1",
        "--palette photo.png --color-mode mean",
        "--color-mode evolved",
        "--mask star",
        "--mask none.svg",
        "--mask bad.png",
        "--shader glossy",
        "--opacity 0",
        "--opacity nan",
        "--opacity 30%",
        "--seed -1",
        "--opacity 0.5 --blend opaque",
        "--colors 0",
        "--colors 257",
        "--colors 6 --palette three.hex",
        "--palette none.gpl",
        "--palette bad.png",
        "--palette notes.csv",
        "--weight none.png",
        "--weight stripe.png",
        "--init none.npz",
        "--init photo.png",
        "--init photo.png -n 5",
        "--save-every 5",
        "--save-run run --save-every 0",
        "--device name:no-such-gpu",
        "--device 99",
        "--device uuid:00000000000000000000000000000000",
        "--device pci:ffff:ff:1f.7",
        "--device cpu --capture 1",
        "--capture zero",
        "--trace photo.png",
        "--trace out.png",
        "--progress loud",
        "--nothing",
    ):
        case(f"refused/{slug(flags)}", f"smalti evolve photo.png -o out.png --json {flags}")
    for name, flags in (
        ("gif", "-o out.gif"),
        ("no-ending", "-o out"),
        ("twice", "-o a.png -o ./a.png"),
        ("stdout-twice", "-o - -o -"),
        ("target-twice", "-o a.png --save-target a.png"),
        ("target-jpg", "-o a.png --save-target a.jpg"),
        ("input", "-o photo.png --force"),
        ("target-input", "-o a.png --save-target ./photo.png --force"),
        ("stdout-json", "-o - --json"),
        ("no-size", "-o a.npz -o a.csv --output-size 9"),
        ("webp", "-o a.webp --output-size 16384"),
        ("nowhere", "-o nowhere/a.png"),
        ("folder", "-o folder.png"),
        ("new-folder", "-o new.png/"),
        ("none", ""),
        ("save-run-file", "-o a.png --save-run photo.png"),
        ("save-run-other", "-o a.png --save-run folder.png"),
    ):
        case(
            f"refused/output-{name}",
            f"mkdir folder.png; echo x > folder.png/x; smalti evolve photo.png -n 30 --evals 300 {flags}",
        )
    case(
        "refused/inputs",
        """
mkdir folder; head -c 500 rgb.png > cut.png; head -c 500 plain.jpg > cut.jpg; : > empty.png
for bad in missing.png folder cut.png cut.jpg empty.png bad.png photo.png/x notes.csv; do smalti evolve $bad -o out.png --json; done
""",
    )
    case(
        "refused/populations",
        """
smalti evolve photo.png -n 30 --evals 300 -q -o p.npz; head -c 600 p.npz > cut.npz
for rest in '--size 20' '-n 60' '--init cut.npz' '--tile-scale 2 --scheme paper'; do smalti evolve photo.png -o a.png --init p.npz $rest; done
smalti evolve stripe.png -o a.png --init p.npz
smalti evolve photo.png -o a.png --init cut.npz
smalti evolve photo.png -o a.png --init p.npz --mitosis 1 --restarts 1 --scheme paper
""",
    )
    case(
        "refused/commands",
        """
smalti nothing
smalti evolve
smalti render
smalti batch
smalti merge
smalti --nothing
smalti bench --nothing
smalti evolve a.png b.png -o c.png
""",
    )
    # Programs are interrupted in the middle: only that they end well can be the same. Without --foreground the signal
    # comes twice, to the program and to its group, and a second one ends smalti at once.
    stop = "timeout --foreground --preserve-status -k 60 -s"
    case(
        "interrupt/evolve",
        f'{stop} INT 2 "$SMALTI" evolve photo.png -n 60 --evals 1000000M -q -o a.npz -o a.png; echo "exit $?"; ls',
        exists=("a.npz", "a.png"),
    )
    case(
        "interrupt/paper",
        f'{stop} TERM 2 "$SMALTI" evolve photo.png --scheme paper -n 60 --births 1000000M -q -o a.png; echo "exit $?"; ls',
        exists=("a.png",),
    )
    case(
        "interrupt/batch",
        f'{stop} USR1 2 "$SMALTI" batch photo.png rgb.png -o out -n 60 --evals 1000000M -q; echo "exit $?"; ls out',
    )
    case("interrupt/video", f'{stop} TERM 2 "$SMALTI" video clip -o out -n 60 --evals 1000000M -q; echo "exit $?"')
    case(
        "interrupt/time",
        """
smalti evolve photo.png -n 60 --evals 1000000M --time 300ms -q -o a.png
smalti evolve photo.png --scheme paper -n 60 --births 1000000M --time 300ms -q -o b.png; ls
""",
        exists=("a.png", "b.png"),
    )
    case(
        "trace/cells",
        "smalti evolve photo.png -n 40 --evals 900 --json -o a.png --trace trace.json",
        exists=("trace.json",),
    )
    case(
        "trace/paper",
        "smalti evolve photo.png --scheme paper -n 40 --births 300 --json -o a.png --trace trace.json",
        exists=("trace.json",),
    )


def on_software_vulkan():
    """A few of each kind on llvmpipe, which is slow: its pipelines are compiled anew in every process."""
    needs = ("llvmpipe",)
    few = "--size 48 -n 60 --evals 700"
    for name, flags in (
        ("free", ""),
        ("mosaic", "--style mosaic"),
        ("paint", "--style paint"),
        ("spray", "--style spray"),
        ("translucent", "--mask flower,disc --opacity 0.5"),
        ("masks", "--mask hexagon,brush --shader emboss --grout white"),
        ("candidates", "--candidates 8 --color-mode mean"),
        ("pick", "--palette three.hex"),
        ("weight", "--weight map.png --style mosaic"),
        ("larger", "--style mosaic --output-size 300 -o a.jpg"),
        ("seed", "--seed 4 --background white"),
    ):
        case(f"vulkan/{name}", f"smalti evolve parrots.png {few} {GPU} --json -o a.png -o a.npz {flags}", needs=needs)
    case(
        "vulkan/transparent",
        f"smalti evolve alpha.png -n 60 --evals 700 {GPU} --json -o a.png -o a.npz --style mosaic",
        needs=needs,
    )
    case(
        "vulkan/init",
        f"""
smalti evolve photo.png -n 40 --evals 400 -q -o p.npz
smalti evolve photo.png --init p.npz --evals 400 --seed 1 {GPU} --json -o a.png
""",
        needs=needs,
    )
    case(
        "vulkan/by-name-number-uuid",
        f"""
line="smalti evolve photo.png -n 20 --evals 100 --json"
$line --device vulkan -o a.png; $line --device 0 -o b.png; SMALTI_DEVICE=name:LLVMpipe $line -o c.png
uuid=$("$SMALTI" devices --json | tr ',{{' '\\n\\n' | sed -n 's/.*"uuid": *"\\([0-9a-f-]*\\)".*/\\1/p' | head -1); $line --device uuid:$uuid -o d.png
""",
        needs=needs,
    )
    births = "--scheme paper --size 48 -n 60 --births 200"
    for name, flags in (
        ("plain", ""),
        ("batch-births", "--batch-births 20 --restarts 1 --cool 0.5"),
        ("flower", "--mask flower --color-mode mean --p-crossover 0.3"),
        ("translucent", "--mask disc --shader soft --batch-births 10"),
        ("split", "--mitosis 1 --restarts 1 --restart-mask border,lines"),
        ("median", "--color-mode median --new-blood 0.1 --no-rotation"),
        ("preset-9", "--preset paper-9"),
        ("output-size", "--output-size 300 --opacity 0.5"),
    ):
        case(
            f"vulkan/paper-{name}",
            f"smalti evolve parrots.png {births} {GPU} --json -o a.png -o a.npz {flags}",
            needs=needs,
        )
    case(
        "vulkan/batch",
        f"{FOLDER}smalti batch in --recursive -o out -n 30 --evals 300 {GPU} --format png,npz --json",
        unordered=True,
        needs=needs,
    )
    case(
        "vulkan/batch-mixed",
        f"""
: rgb.png plain.jpg alpha.png grey.png lossy.webp
smalti batch --manifest work.jsonl -o out -n 30 {GPU} --in-flight 3 --json
""",
        unordered=True,
        needs=needs,
    )
    case(
        "vulkan/batch-paper",
        f"{FOLDER}smalti batch in -o out --scheme paper -n 30 --births 100 {GPU} --json",
        unordered=True,
        needs=needs,
    )
    case(
        "vulkan/batch-devices",
        f"{FOLDER}smalti batch in -o out -n 30 --evals 300 --devices cpu,name:llvmpipe -q",
        needs=needs,
    )
    case(
        "vulkan/video",
        f"smalti video cuts -n 40 --evals 400 --max-tile-move 2 {GPU} -o out --json --frames 1..5",
        needs=needs,
    )
    case(
        "vulkan/render",
        f"""
smalti evolve alpha.png -n 40 --evals 500 -q -o p.npz --style mosaic
smalti evolve photo.png -n 40 --evals 500 -q -o s.npz --style spray
for size in 63 200; do smalti render p.npz {GPU} --json -o p$size.png --output-size $size
smalti render s.npz {GPU} --json -o s$size.png --output-size $size --background white; done
smalti render p.npz {GPU} -q -o m.png --mask flower --shader outline --output-size 90 --supersample 5
""",
        needs=needs,
    )
    case(
        "vulkan/timelapse",
        f"""
smalti evolve photo.png -n 40 --evals 900 -q -o m.png --save-run run
smalti timelapse run -o a.gif -o a.png --frames 5 {GPU}
""",
        needs=needs,
    )
    case(
        "vulkan/trace",
        f"smalti evolve photo.png -n 40 --evals 300 {GPU} --json -o a.png --trace trace.json",
        needs=needs,
        exists=("trace.json",),
    )
    case(
        "vulkan/curve-and-snapshots",
        f"smalti evolve photo.png -n 40 --evals 900 {GPU} --json -o a.png --curve a.csv --curve a.svg --save-run run --save-every 300",
        needs=needs,
    )
    case("vulkan/capture", f"smalti evolve photo.png -n 40 --evals 300 {GPU} -o a.png --capture 1+2", needs=needs)
    case("vulkan/validate", f"smalti evolve photo.png -n 40 --evals 300 {GPU} --json -o a.png --validate", needs=needs)
    case(
        "vulkan/pipelines",
        f"""
export SMALTI_CACHE=$PWD/cache
smalti evolve photo.png -n 40 --evals 300 {GPU} --json -o a.png
smalti evolve photo.png -n 40 --evals 300 {GPU} --json -o b.png; rm -rf cache
""",
        needs=needs,
    )


for part in (
    styles_masks_and_shaders,
    colours_and_pictures,
    going_on,
    outputs,
    papers_scheme,
    presets_and_configuration,
    batches,
    plans_and_merges,
    renders,
    animations,
    measures_pages_and_texts,
    refusals,
    on_software_vulkan,
):
    part()
