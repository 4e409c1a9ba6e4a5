"""What the plug-ins share, with the real program, which SMALTI names."""

import os
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).parents[3]
sys.path.insert(0, str(ROOT / "plugins" / "shared"))

import smalti_program as program  # noqa: E402

PHOTO = str(ROOT / "tests" / "photos" / "parrots.png")
SMALL = {"tiles": 60, "evals": 3000, "size": 64}


def script(folder, name, lines):
    """A stand-in for the program."""
    path = Path(folder, name)
    path.write_text("#!/bin/sh\n" + lines)
    path.chmod(0o755)
    return str(path)


class Finding(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.this = os.environ["SMALTI"]

    def found(self, setting="", **environment):
        environment = {"HOME": self.folder.name, "PATH": self.folder.name, **environment}
        usual = mock.patch.object(program, "_usual_places", lambda: [])
        with mock.patch.dict(os.environ, environment, clear=True), usual:
            return program.find(setting)

    def test_a_setting_goes_before_the_environment_and_that_before_path(self):
        other = script(self.folder.name, "smalti", "echo smalti 9.0.0")
        self.assertEqual(self.found(), other)
        self.assertEqual(self.found(SMALTI=self.this), self.this)
        self.assertEqual(self.found(setting=other, SMALTI=self.this), other)

    def test_none_an_older_and_a_wrong_one_are_told(self):
        with self.assertRaisesRegex(program.Refused, "was not found"):
            self.found()
        with self.assertRaisesRegex(program.Refused, "which the settings name, is no program"):
            self.found(setting="/no/such/program")
        with self.assertRaisesRegex(program.Refused, "which SMALTI names, is no program"):
            self.found(SMALTI="/no/such/program")
        for said, sentence in [("smalti 0.0.9", "is smalti 0.0.9, and this plug-in needs"), ("ls 1.2", "is not smalti")]:
            script(self.folder.name, "smalti", f"echo {said}")
            with self.assertRaisesRegex(program.Refused, sentence):
                self.found()


class Evolving(unittest.TestCase):
    def setUp(self):
        self.this = os.environ["SMALTI"]

    def command(self, *rest):
        return subprocess.run([self.this, "evolve", *rest, "-q"], check=True, stdout=subprocess.PIPE).stdout

    def test_bytes_and_paths_give_what_the_command_line_gives(self):
        for kind in ("png", "svg"):
            for mask, grout in (("auto", "style"), ("disc", "color")):
                options = program.Options(seed=3, mask=mask, grout=grout, grout_color="#ff8000", output_size=128, **SMALL)
                asked = self.command(PHOTO, "-o", "-", "--format", kind, *options.arguments())
                self.assertEqual(program.evolve(self.this, PHOTO, options, kind), asked)
                self.assertEqual(program.evolve(self.this, Path(PHOTO).read_bytes(), options, kind), asked)

    def test_progress_is_told_and_cancels(self):
        shares = []
        program.evolve(self.this, PHOTO, program.Options(tiles=500, evals=400000), progress=shares.append)
        self.assertEqual(shares, sorted(shares))
        self.assertTrue(all(0 <= share <= 1 for share in shares) and len(shares) > 1)
        began = time.monotonic()
        with self.assertRaises(program.Cancelled):
            program.evolve(self.this, PHOTO, program.Options(evals=2000000000), progress=lambda share: False)
        with self.assertRaises(ZeroDivisionError):
            program.evolve(self.this, PHOTO, program.Options(evals=2000000000), progress=lambda share: 1 / 0)
        self.assertLess(time.monotonic() - began, 30)

    def test_failures_have_the_sentence_of_the_program(self):
        for picture, options, sentence in [
            (b"no picture", program.Options(), "stdin|-"),
            ("/no/such/picture.png", program.Options(), "/no/such/picture.png"),
            (PHOTO, program.Options(style="cubist"), "cubist"),
            (PHOTO, program.Options(tiles=2000000), "1000000"),
        ]:
            with self.assertRaisesRegex(program.Refused, sentence) as told:
                program.evolve(self.this, picture, options)
            self.assertNotIn("\n", str(told.exception))
            self.assertFalse(str(told.exception).startswith("smalti: "))

    def test_a_program_that_reads_nothing_does_not_hang(self):
        with tempfile.TemporaryDirectory() as folder:
            silent = script(folder, "smalti", "exit 3")
            with self.assertRaisesRegex(program.Refused, "exit code 3"):
                program.evolve(silent, bytes(10_000_000), program.Options())


class Pixels(unittest.TestCase):
    def test_a_png_holds_the_pixels(self):
        for channels, kind in ((1, 0), (2, 4), (3, 2), (4, 6)):
            pixels = bytes(range(5 * 3 * channels))
            made = program.png(5, 3, channels, pixels)
            self.assertEqual(made[:8], b"\x89PNG\r\n\x1a\n")
            chunks, at = {}, 8
            while at < len(made):
                (length,), name = struct.unpack(">I", made[at : at + 4]), made[at + 4 : at + 8]
                chunks[name] = made[at + 8 : at + 8 + length]
                check = struct.unpack(">I", made[at + 8 + length : at + 12 + length])[0]
                self.assertEqual(check, zlib.crc32(name + chunks[name]))
                at += 12 + length
            self.assertEqual(chunks[b"IHDR"], struct.pack(">IIBBBBB", 5, 3, 8, kind, 0, 0, 0))
            rows = zlib.decompress(chunks[b"IDAT"])
            stride = 5 * channels + 1
            self.assertEqual(b"".join(rows[row * stride + 1 : (row + 1) * stride] for row in range(3)), pixels)
        with self.assertRaises(ValueError):
            program.png(2, 2, 3, b"short")


if __name__ == "__main__":
    unittest.main()
