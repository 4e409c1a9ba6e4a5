"""The package as its users have it, beside the command line where SMALTI names the program."""

import os
import signal
import subprocess
import threading
import time
from pathlib import Path

import numpy
import pytest

import smalti

PHOTOS = Path(os.environ.get("SMALTI_PHOTOS", Path(__file__).parents[2] / "tests" / "photos"))
WORDS = {"tiles": 150, "size": 96, "seed": 5, "evals": 20_000}


@pytest.fixture(scope="module")
def cpu():
    return smalti.Device("cpu")


@pytest.fixture(scope="module")
def pixels():
    image = pytest.importorskip("PIL.Image")
    return numpy.asarray(image.open(PHOTOS / "parrots.png").convert("RGB"))


def flags(words):
    return [part for name, value in words.items() for part in (f"--{name.replace('_', '-')}", str(value))]


@pytest.mark.parametrize("style", ["free", "mosaic", "paint", "spray"])
@pytest.mark.parametrize("ending", ["png", "jpg", "webp", "svg", "ora", "npz", "csv", "json"])
def test_files_have_the_bytes_of_the_command_line(tmp_path, cpu, style, ending):
    program = os.environ.get("SMALTI")
    if program is None:
        pytest.skip("SMALTI names no program")
    words = {"style": style, **WORDS}
    asked, made = tmp_path / f"asked.{ending}", tmp_path / f"made.{ending}"
    photo = PHOTOS / "parrots.png"
    command = [program, "evolve", photo, "-o", asked, "--device", "cpu", "--progress", "none", *flags(words)]
    subprocess.run(command, check=True)
    smalti.evolve(photo, device=cpu, **words).save(made)
    assert made.read_bytes() == asked.read_bytes()


@pytest.mark.parametrize("style", ["mosaic", "spray"])
def test_pixels_give_the_tiles_of_the_file(cpu, pixels, style):
    of_file = smalti.evolve(PHOTOS / "parrots.png", device=cpu, style=style, **WORDS)
    pillow = pytest.importorskip("PIL.Image").fromarray(pixels)
    for picture in [pixels, pixels / 255, numpy.asfortranarray(pixels), pillow]:
        of_pixels = smalti.evolve(picture, device=cpu, style=style, **WORDS)
        assert (of_pixels.tiles == of_file.tiles).all()
        assert (of_pixels.image(200) == of_file.image(200)).all()
        assert (of_pixels.sae, of_pixels.psnr) == (of_file.sae, of_file.psnr)


def test_a_mosaic_tells_what_it_is(cpu, pixels):
    mosaic = smalti.evolve(pixels, device=cpu, style="mosaic", **WORDS)
    width, height = mosaic.size
    assert max(width, height) == 96 and mosaic.image().shape == (height, width, 3)
    assert mosaic.image(384).shape[1 if width >= height else 0] == 384
    tiles = mosaic.tiles
    assert 0 < len(tiles) <= 150 and tiles.dtype == smalti.TILE
    assert (0 <= tiles["angle"]).all() and (tiles["angle"] < 360).all() and (tiles["width"] > 0).all()
    assert mosaic.svg().startswith("<") and mosaic._repr_png_().startswith(b"\x89PNG")
    assert mosaic.stop_reason == "evals" and f"{len(tiles)} tiles" in repr(mosaic)


def test_alpha_masks_palettes_and_weights_are_taken(cpu, tmp_path, pixels):
    clear = numpy.dstack([pixels, numpy.full(pixels.shape[:2], 255, numpy.uint8)])
    clear[: len(clear) // 2, :, 3] = 0
    assert smalti.evolve(clear, device=cpu, **WORDS).image().shape[2] == 4
    leaf = tmp_path / "leaf.svg"
    leaf.write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><circle cx="4" cy="4" r="4"/></svg>')
    weight = numpy.zeros(pixels.shape[:2])
    weight[:50] = 1
    mosaic = smalti.evolve(
        pixels, device=cpu, mask=["disc", leaf, leaf.read_bytes()], palette=[(0, 0, 0), (255, 255, 255)], weight=weight, **WORDS
    )
    assert set(mosaic.tiles["r"]) <= {0, 255} and len(set(mosaic.tiles["mask"])) > 1


def test_progress_is_told_and_ends_the_work(cpu, pixels):
    told = []
    smalti.evolve(pixels, device=cpu, tiles=800, size=256, progress=lambda share, error: told.append((share, error)))
    shares = [share for share, _ in told]
    assert shares == sorted(shares) and all(0 <= share <= 1 for share in shares) and len(told) > 1
    stopped = smalti.evolve(pixels, device=cpu, tiles=800, size=256, progress=lambda share, error: False)
    assert stopped.stop_reason == "interrupted"
    with pytest.raises(ZeroDivisionError):
        smalti.evolve(pixels, device=cpu, tiles=800, size=256, progress=lambda share, error: 1 / 0)


def test_other_threads_run_and_ctrl_c_ends_the_work(cpu, pixels):
    ticks = []
    ended = threading.Event()

    def tick():
        while not ended.wait(0.01):
            ticks.append(time.monotonic())
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=tick, daemon=True).start()
    threading.Timer(0.5, ended.set).start()
    with pytest.raises(KeyboardInterrupt):
        smalti.evolve(pixels, device=cpu, tiles=3_000, evals=2_000_000_000)
    assert len(ticks) > 10


def test_what_cannot_be_is_told_in_one_sentence(cpu, tmp_path, pixels):
    for words, sentence in [
        ({"tiles": 0}, "tiles 0: must be 1 to 1000000"),
        ({"tiles": -5}, "tiles: -5"),
        ({"tile": 5}, "there is no tile"),
        ({"style": "cubist"}, "there is no such style"),
        ({"mask": "triangel"}, "triangel"),
        ({"weight": numpy.zeros(9, numpy.uint8)}, "needs (height, width)"),
    ]:
        with pytest.raises(ValueError) as told:
            smalti.evolve(pixels, device=cpu, **words)
        assert sentence in str(told.value) and "\n" not in str(told.value)
    for picture in [numpy.zeros((4, 4, 2), numpy.uint8), numpy.zeros((4, 4, 3), int), numpy.full((4, 4), 7.0), numpy.zeros((0, 4, 3), numpy.uint8)]:
        with pytest.raises(ValueError, match="picture"):
            smalti.evolve(picture, device=cpu)
    with pytest.raises(OSError, match="none.png"):
        smalti.evolve(tmp_path / "none.png", device=cpu)
    mosaic = smalti.evolve(pixels, device=cpu, **WORDS)
    with pytest.raises(OSError, match="does not end in"):
        mosaic.save(tmp_path / "mosaic.xyz")
    with pytest.raises(OSError):
        mosaic.save(tmp_path / "no" / "mosaic.png")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="no such device"):
        smalti.Device("no such device")
    with pytest.raises(RuntimeError, match="no suitable device"):
        smalti.Device("name:no such card")
