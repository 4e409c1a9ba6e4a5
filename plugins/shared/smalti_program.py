"""Finds the program smalti and has it evolve a picture.

What the plug-ins for GIMP 3, Krita and Inkscape share. It knows none of these hosts and needs nothing but Python's own
library. Pictures go in and come out through pipes, so that nothing is left on the disk when a host is killed; the
protocol is told in docs/plugins.md.
"""

import json
import os
import queue
import re
import shutil
import signal
import struct
import subprocess
import sys
import threading
import zlib

#: The version of smalti that this file came with. An older program may not know what is asked of it here.
VERSION = "0.1.0"

#: Names of styles, as the program has them and as people read them.
STYLES = (("mosaic", "Mosaic"), ("paint", "Brush strokes"), ("spray", "Clouds of spray"), ("free", "Closest likeness"))

#: Shapes of tiles; the first leaves the choice to the style.
MASKS = (
    ("auto", "As the style has it"),
    ("square", "Squares"),
    ("border", "Squares with a dark edge"),
    ("lines", "Cords"),
    ("flower", "Flowers"),
    ("disc", "Discs"),
    ("triangle", "Triangles"),
    ("hexagon", "Hexagons"),
    ("brush", "Brush strokes"),
)

#: Kinds of grout; the first leaves the choice to the style.
GROUTS = (("style", "As the style has it"), ("none", "None"), ("auto", "A little darker than the picture"), ("color", "Of one colour"))

#: How long a plug-in may leave its host without an answer.
TICK_S = 0.1

#: A file beside this one that names the program; `smalti plugins install` writes it.
NOTE = "smalti_program.txt"


class Refused(Exception):
    """Why there is no mosaic: one sentence for the person before the picture."""


class Cancelled(Exception):
    """The person has asked to stop."""


class Options:
    """What a plug-in asks for; ``arguments`` says it in flags of `smalti evolve`.

    ``tiles`` and ``evals`` are 0 where the program may choose. ``size`` is the longer side in px at which the picture
    evolves, and ``output_size`` that at which it is drawn. ``grout`` is one of GROUTS, ``grout_color`` as ``#rrggbb``.
    """

    def __init__(
        self,
        style="mosaic",
        tiles=0,
        seed=0,
        mask="auto",
        grout="style",
        grout_color="#808080",
        evals=0,
        size=512,
        output_size=0,
        device="",
    ):
        self.style = style
        self.tiles = tiles
        self.seed = seed
        self.mask = mask
        self.grout = grout
        self.grout_color = grout_color
        self.evals = evals
        self.size = size
        self.output_size = output_size
        self.device = device

    def arguments(self):
        """The flags."""
        flags = ["--style", self.style, "--seed", str(self.seed), "--size", str(self.size)]
        if self.tiles:
            flags += ["--tiles", str(self.tiles)]
        if self.mask != "auto":
            flags += ["--mask", self.mask]
        if self.grout != "style":
            flags += ["--grout", self.grout_color if self.grout == "color" else self.grout]
        if self.evals:
            flags += ["--evals", str(self.evals)]
        if self.output_size:
            flags += ["--output-size", str(self.output_size)]
        if self.device:
            flags += ["--device", self.device]
        return flags


def find(setting=""):
    """The path of the program: what a person has set, ``SMALTI``, what installed this plug-in, PATH, usual folders.

    Raises Refused if there is none, or if it is older than this plug-in.
    """
    for named, where in ((setting, "the settings"), (os.environ.get("SMALTI", ""), "SMALTI")):
        if named:
            found = shutil.which(os.path.expanduser(named))
            if not found:
                raise Refused(f"{named}, which {where} name{'s' if where == 'SMALTI' else ''}, is no program")
            return _checked(found)
    for place in (_noted(), shutil.which("smalti"), *_usual_places()):
        if place and os.access(place, os.X_OK) and os.path.isfile(place):
            return _checked(place)
    raise Refused(
        "The program smalti was not found. Install it (cargo install --locked --path . in its source), "
        "put it on the PATH, or name it in the environment variable SMALTI"
    )


def evolve(program, picture, options, kind="png", progress=None):
    """Has the program evolve a picture; returns the bytes of the file that it makes, of the format ``kind``.

    ``picture`` is the bytes of a file, or a path. ``progress(share)`` is called on this thread about ten times a second,
    with what is done from 0 to 1, and stops the work if it returns False. Raises Cancelled then, and Refused with the
    program's own sentence if it fails.
    """
    is_path = isinstance(picture, str)
    source = picture if is_path else "-"
    command = [program, "evolve", source, "-o", "-", "--format", kind, "--progress", "json", *options.arguments()]
    with _started(command, subprocess.DEVNULL if is_path else subprocess.PIPE) as child:
        made, said = [], queue.Queue()
        threads = [
            threading.Thread(target=_take, args=(child.stdout, made), daemon=True),
            threading.Thread(target=_listen, args=(child.stderr, said), daemon=True),
        ]
        if not is_path:
            threads.append(threading.Thread(target=_give, args=(child.stdin, picture), daemon=True))
        for thread in threads:
            thread.start()
        try:
            sentence = _watch(said, progress)
        except BaseException:
            # Nothing that it has begun is of any use, and it has no file open.
            child.kill()
            raise
        finally:
            for thread in threads:
                thread.join()
        code = child.wait()
    if code:
        raise Refused(sentence or f"smalti ended with exit code {code} and gave no reason")
    return b"".join(made)


def png(width, height, channels, pixels, profile=None):
    """Pixels as a PNG: rows from above, 8 bits a channel, of 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA) channels.

    ``profile`` is an ICC profile, if the pixels are not sRGB.
    """
    stride = width * channels
    if len(pixels) != stride * height:
        raise ValueError(f"{len(pixels)} bytes are not {width}x{height} px of {channels} channels")
    kind = {1: 0, 2: 4, 3: 2, 4: 6}[channels]
    packer = zlib.compressobj(1)
    packed = []
    pixels = memoryview(pixels)
    for row in range(height):
        packed.append(packer.compress(b"\0"))
        packed.append(packer.compress(pixels[row * stride : (row + 1) * stride]))
    packed.append(packer.flush())
    chunks = [_chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, kind, 0, 0, 0))]
    if profile:
        chunks.append(_chunk(b"iCCP", b"icc\0\0" + zlib.compress(profile)))
    chunks += [_chunk(b"IDAT", b"".join(packed)), _chunk(b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)


def _chunk(name, content):
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def _started(command, stdin):
    # A host without a console would open a window for it on Windows.
    flags = getattr(subprocess, "CREATE_NO_WINDOW", 0)
    try:
        return subprocess.Popen(
            command, stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, creationflags=flags
        )
    except OSError as error:
        raise Refused(f"{command[0]} cannot be started: {error.strerror or error}") from error


def _take(stream, chunks):
    chunks.append(stream.read())


def _give(stream, content):
    if hasattr(signal, "pthread_sigmask"):
        # A program that ends without reading must not end a host that embeds Python and does not ignore SIGPIPE.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGPIPE})
    try:
        with stream:
            stream.write(content)
    except OSError:
        # It has ended early, and says why on its own.
        pass


def _listen(stream, lines):
    for line in stream:
        lines.put(line.decode("utf-8", "replace").strip())
    lines.put(None)


def _watch(said, progress):
    """Listens until the program has ended; returns the last sentence that is not about its progress."""
    sentence, share = "", 0.0
    while True:
        try:
            line = said.get(timeout=TICK_S)
        except queue.Empty:
            line = ""
        if line is None:
            return sentence
        told = _share(line)
        if told is None:
            sentence = re.sub(r"^smalti: ", "", line) or sentence
        else:
            share = max(share, told)
        if progress and progress(share) is False:
            raise Cancelled


def _share(line):
    """What is done, 0 to 1, as a line of ``--progress json`` tells it; None of another line."""
    try:
        told = json.loads(line)
        for unit in ("evals", "births"):
            if unit in told:
                return min(1.0, told[unit] / max(1, told[unit + "_planned"]))
        # The drawing comes last.
        return 1.0 if "drawn_share" in told else None
    except (ValueError, KeyError, TypeError):
        return None


def _checked(program):
    """The program, if it is not older than this plug-in."""
    with _started([program, "--version"], subprocess.DEVNULL) as child:
        told, _ = child.communicate()
    found = re.search(r"^smalti (\d+(?:\.\d+)+)", told.decode("utf-8", "replace"))
    if not found:
        raise Refused(f"{program} is not smalti: it does not tell a version")
    if _numbers(found.group(1)) < _numbers(VERSION):
        raise Refused(
            f"{program} is smalti {found.group(1)}, and this plug-in needs {VERSION} or later. Install a newer one, or "
            "have the program install its own plug-in: smalti plugins install"
        )
    return program


def _numbers(version):
    return [int(part) for part in version.split(".")]


def _noted():
    """The program that has installed this plug-in."""
    try:
        with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), NOTE), encoding="utf-8") as note:
            return note.read().strip()
    except OSError:
        return None


def _usual_places():
    name = "smalti.exe" if sys.platform == "win32" else "smalti"
    folders = ["~/.cargo/bin", "~/.local/bin", "/usr/local/bin", "/usr/bin", "/opt/homebrew/bin"]
    # A Flatpak sees the programs of its host there.
    folders += ["/run/host/usr/local/bin", "/run/host/usr/bin"]
    return [os.path.join(os.path.expanduser(folder), name) for folder in folders]
