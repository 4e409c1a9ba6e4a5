"""The package as its users have it, beside the command line where SMALTI names the program."""

import os
import signal
import subprocess
import sys
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


def test_many_pictures_are_each_as_alone(cpu, pixels):
    pictures = [pixels, PHOTOS / "woman.jpg", pixels[:40, :60], pixels[:, ::-1]]
    alone = [smalti.evolve(picture, device=cpu, style="mosaic", **WORDS) for picture in pictures]
    for device in [cpu, *vulkan()]:
        made = dict(smalti.evolve_many(iter(pictures), device=device, style="mosaic", **WORDS))
        assert sorted(made) == [0, 1, 2, 3]
        for number, mosaic in enumerate(alone):
            assert (made[number].tiles == mosaic.tiles).all() and (made[number].image(150) == mosaic.image(150)).all()
    assert list(smalti.evolve_many([], device=cpu)) == []


def vulkan():
    """The software driver, where there is one; what it makes must be the same."""
    try:
        return [smalti.Device("name:llvmpipe")]
    except RuntimeError:
        return []


def test_one_bad_picture_among_many_is_told_and_the_others_are_made(cpu, pixels, tmp_path):
    pictures = [pixels, tmp_path / "none.png", numpy.zeros((4, 4, 2), numpy.uint8), pixels]
    made = dict(smalti.evolve_many(pictures, device=cpu, on_error="yield", **WORDS))
    assert isinstance(made[1], OSError) and "none.png" in str(made[1])
    assert isinstance(made[2], ValueError) and "shape" in str(made[2])
    assert (made[0].tiles == made[3].tiles).all()
    with pytest.raises(OSError, match="none.png"):
        list(smalti.evolve_many([tmp_path / "none.png"], device=cpu, **WORDS))
    with pytest.raises(ValueError, match="tiles 0"):
        smalti.evolve_many(pictures, tiles=0)
    with pytest.raises(ValueError, match="one picture"):
        smalti.evolve_many("photo.jpg")


def test_many_pictures_end_when_nobody_wants_more(cpu, pixels):
    def endless():
        while True:
            yield pixels

    for _, mosaic in smalti.evolve_many(endless(), device=cpu, **WORDS):
        assert len(mosaic.tiles) > 0
        break

    def broken():
        yield pixels
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        list(smalti.evolve_many(broken(), device=cpu, **WORDS))
    # An iterator that waits for something stops nobody.
    waiting = threading.Event()
    work = smalti.evolve_many(iter(lambda: waiting.wait() and None, 1), device=cpu)
    work.close()
    waiting.set()
    # Nobody has taken anything.
    del work
    smalti.evolve_many(endless(), device=cpu, evals=2_000_000_000)
    # A process that ends in the middle of it ends all the same.
    script = (
        "import numpy, smalti, itertools\n"
        "work = smalti.evolve_many(itertools.repeat(numpy.zeros((40, 40, 3), numpy.uint8)), evals=2_000_000_000)\n"
        "import time; time.sleep(0.3)\n"
    )
    assert subprocess.run([sys.executable, "-c", script], timeout=60).returncode == 0


@pytest.mark.parametrize("work", ["smalti.evolve({}, evals=2_000_000_000)", "list(smalti.evolve_many([{}] * 4, evals=2_000_000_000))"])
def test_ctrl_c_ends_a_script(work):
    photo = str(PHOTOS / "woman.jpg")
    script = f"import smalti\nprint('go', flush=True)\n{work.format(repr(photo))}"
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as child:
        assert child.stdout.readline() == "go\n"
        time.sleep(0.5)
        child.send_signal(signal.SIGINT)
        _, said = child.communicate(timeout=60)
    assert "KeyboardInterrupt" in said


def test_a_mosaic_goes_on_from_another(cpu, pixels, tmp_path):
    first = smalti.evolve(pixels, device=cpu, style="mosaic", **WORDS)
    first.save(tmp_path / "first.npz")
    words = {"style": "mosaic", "size": 96, "seed": 6, "evals": 20_000}
    of_memory = smalti.evolve(pixels, device=cpu, init=first, **words)
    of_file = smalti.evolve(pixels, device=cpu, init=tmp_path / "first.npz", **words)
    assert (of_memory.tiles == of_file.tiles).all() and of_memory.objective < first.objective
    population = first.population
    assert population["x"].shape == (150,) and population["alive"].dtype == bool
    assert population["mask_0"].shape == (256, 256, 2)


def test_presets_and_words_of_the_paper_mean_what_the_flags_mean(cpu, tmp_path):
    program = os.environ.get("SMALTI")
    if program is None:
        pytest.skip("SMALTI names no program")
    own = tmp_path / "own.toml"
    own.write_text('style = "mosaic"\ngrout = "white"\n')
    photo = PHOTOS / "parrots.png"
    paper = {"tiles": 60, "size": 48, "births": 1_500}
    for words in [
        {"preset": own, **WORDS},
        {"preset": "paint", **WORDS},
        {"preset": "paper-3", **paper},
        {"scheme": "paper", "restarts": 1, "cool": 0.5, "restart_mask": "flower", "on_dry": "stop", "no_rotation": True, **paper},
    ]:
        asked, made = tmp_path / "asked.npz", tmp_path / "made.npz"
        given = [part for part in flags({name: value for name, value in words.items() if value is not True})]
        given += [f"--{name.replace('_', '-')}" for name, value in words.items() if value is True]
        command = [program, "evolve", photo, "-o", asked, "--force", "--device", "cpu", "--progress", "none", *given]
        subprocess.run(command, check=True)
        smalti.evolve(photo, device=cpu, **words).save(made)
        assert made.read_bytes() == asked.read_bytes(), words


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
