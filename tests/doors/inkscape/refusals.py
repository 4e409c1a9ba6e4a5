"""Checks that a trace that cannot be made says why in one sentence and changes nothing, and that one that is broken off
leaves nothing at work.
"""

import os
import signal
import subprocess
import sys
import time

from room import EXTENSION, PROGRAM, check, drawing, embedded, end, photo, set_in_the_dialog, smalti_program

NUMBER = "987654321"
LONG = ["--evals=2000000000", f"--seed={NUMBER}"]
BITMAP = f'width="63" height="48" xlink:href="{embedded(photo("rgb.png"))}"'


def started(content, ids, *more, **environment):
    """The extension, as Inkscape starts it."""
    path = drawing(content)
    inkscape = {"PYTHONPATH": "/usr/share/inkscape/extensions", "DOCUMENT_PATH": path}
    selected = [f"--id={name}" for name in ids]
    return subprocess.Popen(
        [sys.executable, "smalti_trace.py", *selected, "--tab=look", "--tiles=80", "--evals=3000", *more, path],
        cwd=EXTENSION,
        env={**os.environ, **inkscape, **environment},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )


def refused(what, sentence, content, ids, *more, **environment):
    child = started(content, ids, *more, **environment)
    made, said = child.communicate(timeout=60)
    said = said.decode()
    right = said.count("\n") == 1 and sentence in said and child.returncode and not made
    check(f"{what}: {said.strip()}", right, f"{said!r} does not say {sentence!r}, or {len(made)} bytes were made")


def script(name, *lines):
    """Another program in the place of smalti."""
    with open(name, "w", encoding="utf-8") as file:
        file.write("\n".join(("#!/bin/sh", *lines)) + "\n")
    os.chmod(name, 0o755)
    return os.path.abspath(name)


def image(name, attributes):
    return f'<image id="{name}" {attributes}/>'


good = image("good", BITMAP)
refused("nothing is selected", "Select a bitmap first", good, [])
refused("no bitmap is selected", "there is none in what is selected", good + '<rect id="r"/>', ["r"])
refused("a clone is selected", "unlink it", good + '<use id="u" xlink:href="#good"/>', ["u"])
refused("tiles are selected", "there is none", f'<g id="g"><defs>{good}</defs></g>', ["g"])


def bad(what, sentence, attributes):
    """Nothing may be made of a good bitmap, either, that is traced together with a bad one."""
    refused(what, f"No tiles for the bitmap bad: {sentence}", good + image("bad", attributes), ["good", "bad"])


place = 'width="63" height="48"'
bad("a link that leads nowhere", "the file that it is linked to is missing (/", f'{place} xlink:href="bad.png"')
bad("a bitmap from the web", "its picture is on another machine", f'{place} xlink:href="https://example.org/bad.png"')
bad("a bitmap without a picture", "it has no picture", place)
bad("damaged base64", "its embedded picture is damaged", f'{place} xlink:href="data:image/png;base64,*!"')
bad("half a data URI", "its embedded picture is damaged", f'{place} xlink:href="data:image/png"')
bad("a drawing as a bitmap", "it is a drawing", f'{place} xlink:href="data:image/svg+xml,%3Csvg/%3E"')
bad("what is no picture", "not a picture that can be read", f'{place} xlink:href="{embedded(b"not a picture")}"')
bad("a bitmap without an area", "it has no area", BITMAP.replace('"63"', '"0"'))
bad("a place in letters", "its place on the drawing is not understood (5em)", f'x="5em" {BITMAP}')

refused("the program is not where SMALTI says", "is no program", good, ["good"], SMALTI="/nowhere/smalti")
refused("there is no program", "smalti was not found", good, ["good"], SMALTI="", PATH="/usr/bin:/bin")
refused("the program is not where the dialog says", "is no program", good, ["good"], "--program=/nowhere/smalti")
old = script("old", "echo smalti 0.0.9")
refused("the program is older", "is smalti 0.0.9, and this plug-in needs", good, ["good"], SMALTI=old)
ill = script("ill", '[ "$1" = --version ] && exec echo smalti 99.0', 'echo "smalti: it rains" >&2', "exit 1")
refused("the program fails", "No tiles for the bitmap good: it rains", good, ["good"], SMALTI=ill)


def makes(what, *more, content=good, **environment):
    made, said = started(content, ["good"], *more, **environment).communicate(timeout=60)
    check(what, made.count(b"<path") > 1 and not said, said.decode())


makes("the dialog tells where the program is", f"--program={PROGRAM}", SMALTI="")
note = os.path.join(EXTENSION, "smalti_program.txt")
with open(note, "w", encoding="utf-8") as file:
    file.write(PROGRAM + "\n")
makes("the note of smalti plugins install tells where the program is", SMALTI="", PATH="/usr/bin:/bin")
os.remove(note)
pixel = embedded(smalti_program.png(1, 1, 3, b"\x80\x40\x20"))
makes("a bitmap of one pixel becomes tiles, too", content=image("good", f'xlink:href="{pixel}"'))


def at_work():
    """The program, if it is at the long search that only these checks ask for."""
    found = []
    for number in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{number}/cmdline", "rb") as file:
                words = file.read().split(b"\0")
        except OSError:
            continue
        if NUMBER.encode() in words or f"--seed={NUMBER}".encode() in words:
            found.append(int(number))
    return found


def until(condition, limit_s=20):
    """Whether it comes true in time."""
    ends = time.monotonic() + limit_s
    while not condition():
        if time.monotonic() > ends:
            return False
        time.sleep(0.1)
    return True


def broken_off(what, start, breaking):
    child = start()
    # The extension and the program.
    begun = until(lambda: len(at_work()) == 2)
    time.sleep(0.5)
    breaking(child)
    over = until(lambda: not at_work(), 5)
    for number in at_work():
        os.kill(number, signal.SIGKILL)
    child.wait()
    check(f"nothing goes on when {what}", begun and over, "it was not begun" if not begun else "the program goes on")


def close(child):
    child.stdout.close()
    child.stderr.close()


def inkscape():
    set_in_the_dialog(tiles=80, evals=2000000000, seed=NUMBER)
    actions = "--actions=select-by-id:good;smalti.trace.noprefs"
    return subprocess.Popen(["inkscape", "--batch-process", drawing(good), actions], stderr=subprocess.DEVNULL)


broken_off("the extension is ended", lambda: started(good, ["good"], *LONG), subprocess.Popen.terminate)
broken_off("Inkscape does not listen any more", lambda: started(good, ["good"], *LONG), close)
broken_off("Inkscape is killed", inkscape, subprocess.Popen.kill)

end()
