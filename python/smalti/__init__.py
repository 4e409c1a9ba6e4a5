"""Turns pictures into mosaics by evolving thousands of tiles with the Fly algorithm.

>>> import numpy, smalti
>>> picture = numpy.zeros((40, 60, 3), numpy.uint8)
>>> picture[:, 30:] = 255, 160, 0
>>> mosaic = smalti.evolve(picture, style="mosaic", tiles=40, seed=7)
>>> mosaic.image().shape
(40, 60, 3)
>>> len(mosaic.tiles) <= 40
True

The same picture, the same words and the same seed give the same tiles, on every device and with any number of threads,
and the same files as ``smalti evolve`` writes.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import weakref
from collections.abc import Callable, Iterable
from typing import Any, Literal

import numpy

from ._smalti import Device, Many as _Many, Mosaic as _Mosaic, evolve as _evolve, evolve_many as _evolve_many

__all__ = ["TILE", "Device", "Mosaic", "Mosaics", "evolve", "evolve_many"]

#: What :attr:`Mosaic.tiles` holds of each tile. Lengths and places are in px of the evolved picture, where pixel
#: (i, j) has its centre at x = i, y = j, and y points down.
TILE = numpy.dtype(
    [
        ("x", numpy.float32),  # centre
        ("y", numpy.float32),
        ("width", numpy.float32),  # before it is turned
        ("height", numpy.float32),
        ("angle", numpy.float32),  # degrees from +x towards +y, 0 to 360
        ("depth", numpy.float32),  # -1 to 1, smaller is nearer the eye
        ("r", numpy.uint8),  # sRGB
        ("g", numpy.uint8),
        ("b", numpy.uint8),
        ("mask", numpy.uint16),  # layer of the masks, 0 is the square
        ("fitness", numpy.int64),  # what the likeness would lose without it
        ("index", numpy.uint64),  # number in the population
    ]
)


class Mosaic:
    """A finished mosaic: its tiles, its score, its pixels at any size, and its files."""

    __slots__ = ("__weakref__", "_made")

    def __init__(self, made: _Mosaic) -> None:
        self._made = made

    @property
    def sae(self) -> int:
        """Sum of absolute errors of all 8-bit channels; lower is better."""
        return self._made.sae

    @property
    def objective(self) -> int:
        """What was lowered: the SAE, with the penalties of the style and the weights if there are any."""
        return self._made.objective

    @property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio in dB; infinite where nothing differs."""
        return self._made.psnr

    @property
    def evals(self) -> int:
        """Children that were evaluated; in the paper's scheme each is a birth."""
        return self._made.evals

    @property
    def births(self) -> int:
        """New tiles that took a place."""
        return self._made.births

    @property
    def stop_reason(self) -> str:
        """Why the work ended: ``evals``, ``births``, ``patience``, ``dry``, ``target-sae`` or ``interrupted``."""
        return self._made.stop_reason

    @property
    def key(self) -> str:
        """What identifies the result: a hash of the picture, the words and the version."""
        return self._made.key

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in px of the picture as it evolved."""
        return self._made.size_px

    @property
    def tiles(self) -> numpy.ndarray:
        """The tiles as a structured array of :data:`TILE`; ``pandas.DataFrame(mosaic.tiles)`` makes a table of it."""
        columns = self._made.columns()
        tiles = numpy.empty(len(columns["x"]), TILE)
        for name in TILE.names or ():
            tiles[name] = columns[name]
        return tiles

    @property
    def population(self) -> dict[str, numpy.ndarray]:
        """All flies, also those that have died, and their masks: what a saved .npz holds, by name (docs/reference.md)."""
        with numpy.load(io.BytesIO(self._made.npz())) as archive:
            return {name: archive[name] for name in archive.files if not name.endswith(".json")}

    def image(self, size: int | None = None) -> numpy.ndarray:
        """The pixels, height x width x 3 (4 with alpha, if nothing lies behind the tiles) as bytes.

        ``size`` is the longer side in px; tiles are drawn anew for it, so that they are sharp.
        """
        return self._sized(size).pixels()

    def svg(self) -> str:
        """The tiles as SVG, one element for each."""
        return self._made.svg().decode()

    def save(self, path: str | os.PathLike[str], size: int | None = None) -> None:
        """Writes a file in the format that its name ends in: .png, .jpg, .webp, .svg, .ora, .npz, .csv or .json.

        ``size`` is the longer side in px of a picture. The file is there as a whole or not at all.
        """
        self._sized(size).save(path)

    def _sized(self, size: int | None) -> _Mosaic:
        return self._made if size is None else self._made.resized(size)

    def _repr_png_(self) -> bytes:
        return self._made.png()

    def _repr_svg_(self) -> str | None:
        # Notebooks take the last that is there, and thousands of elements are slow to show.
        return self.svg() if len(self.tiles) <= 1_000 else None

    def __repr__(self) -> str:
        width, height = self.size
        return f"<smalti.Mosaic of {len(self.tiles)} tiles, {width}x{height} px, SAE {self.sae}>"


def evolve(
    picture: Any,
    *,
    device: Device | None = None,
    progress: Callable[[float, int], bool | None] | None = None,
    **words: Any,
) -> Mosaic:
    """Evolves a picture into a mosaic.

    ``picture`` is a path, an array (height x width, or x 3 or 4; bytes, or real numbers from 0 to 1), or an image of
    Pillow. ``words`` are the flags of ``smalti evolve`` with underscores: ``style``, ``tiles``, ``size``, ``seed``,
    ``evals``, ``mask``, ``shader``, ``grout``, ``grout_width``, ``colors``, ``palette``, ``background``, ``weight``,
    ``preset`` and so on; an unknown word is refused with a list of the known ones. ``mask`` is a name, a path, the bytes
    of a file, or a list of these; ``palette`` a path or a list of (r, g, b); ``weight`` a path or an array of bytes
    (height x width); ``init`` a path or a :class:`Mosaic`.

    ``progress(share, error)`` is called about ten times a second. If it returns False, the mosaic is as it has become
    until then; what it raises ends the work and is raised here.

    Raises ``ValueError`` about a wrong word or picture, ``OSError`` about a file, ``RuntimeError`` about a device.

    >>> import numpy, smalti
    >>> smalti.evolve(numpy.zeros((8, 8, 3), numpy.uint8), tiles=0)
    Traceback (most recent call last):
    ValueError: tiles 0: must be 1 to 1000000
    """
    return Mosaic(_evolve(_picture(picture), _checked(words), device, progress))


def evolve_many(
    pictures: Iterable[Any],
    *,
    device: Device | None = None,
    on_error: Literal["raise", "yield"] = "raise",
    **words: Any,
) -> Mosaics:
    """Evolves many pictures at once, on all cores or as lanes of a device.

    Gives pairs of a number, counted from 0 in the order of ``pictures``, and its :class:`Mosaic`, as they end: in any
    order. Each mosaic is the one that :func:`evolve` makes with the same words. ``pictures`` is read as pictures are
    needed, by another thread, so it may be a generator that never ends; leave the loop, and the work ends.

    A picture that cannot be used raises its exception, which ends the work. With ``on_error="yield"`` the exception
    comes in the place of the mosaic, and the others go on.

    >>> import numpy, smalti
    >>> pictures = [numpy.full((8, 12, 3), grey, numpy.uint8) for grey in (0, 255)]
    >>> sorted((number, mosaic.size) for number, mosaic in smalti.evolve_many(pictures, tiles=4))
    [(0, (12, 8)), (1, (12, 8))]
    """
    if on_error not in ("raise", "yield"):
        raise ValueError(f"on_error: {on_error!r} is neither 'raise' nor 'yield'")
    if isinstance(pictures, (str, bytes, os.PathLike)):
        raise ValueError("pictures: is one picture, and must be several; smalti.evolve makes a mosaic of one")
    many = _evolve_many(_Pictures(pictures), _checked(words), device)
    mosaics = Mosaics(many, on_error == "raise")
    _at_work.add(mosaics)
    return mosaics


class Mosaics:
    """Mosaics as they end: what :func:`evolve_many` returns. The work ends with the loop, or by ``close()``."""

    def __init__(self, many: _Many, is_raised: bool) -> None:
        self._many = many
        self._is_raised = is_raised

    def __iter__(self) -> Mosaics:
        return self

    def __next__(self) -> tuple[int, Any]:
        try:
            number, made = next(self._many)
            if isinstance(made, BaseException) and self._is_raised:
                raise made
        except BaseException:
            self.close()
            raise
        return number, made if isinstance(made, BaseException) else Mosaic(made)

    def close(self) -> None:
        """Ends the work; nothing comes any more."""
        self._many.close()

    def __enter__(self) -> Mosaics:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __del__(self) -> None:
        self.close()


#: What still works when the interpreter ends must end first, since it reads pictures by it.
_at_work: weakref.WeakSet[Mosaics] = weakref.WeakSet()


@atexit.register
def _end_all() -> None:
    for mosaics in list(_at_work):
        with contextlib.suppress(Exception):
            mosaics.close()


class _Pictures:
    """Pictures as the library takes them; what is none is handed on, and refused there by its number."""

    def __init__(self, pictures: Iterable[Any]) -> None:
        self._pictures = iter(pictures)

    def __iter__(self) -> _Pictures:
        return self

    def __next__(self) -> Any:
        picture = next(self._pictures)
        try:
            return _picture(picture)
        except Exception as refusal:
            return refusal


def _checked(words: dict[str, Any]) -> dict[str, Any]:
    """The words, with maps and mosaics as the library takes them."""
    words = dict(words)
    weight = words.get("weight")
    if weight is not None and not isinstance(weight, (str, os.PathLike)):
        words["weight"] = _bytes_of(numpy.asarray(weight), "weight")
        if words["weight"].ndim != 2:
            raise ValueError(f"weight: has the shape {words['weight'].shape}, and needs (height, width)")
    if isinstance(words.get("init"), Mosaic):
        words["init"] = words["init"]._made
    return words


def _picture(picture: Any) -> Any:
    if isinstance(picture, (str, os.PathLike)):
        return os.fspath(picture)
    if hasattr(picture, "getbands") and hasattr(picture, "convert"):
        has_alpha = "A" in picture.getbands() or "transparency" in picture.info
        picture = picture.convert("RGBA" if has_alpha else "RGB")
    pixels = _bytes_of(numpy.asarray(picture), "picture")
    if pixels.ndim == 2:
        pixels = numpy.repeat(pixels[:, :, None], 3, axis=2)
    if pixels.ndim != 3 or pixels.shape[2] not in (3, 4):
        raise ValueError(f"picture: has the shape {pixels.shape}, and needs (height, width), or that with 3 or 4 channels")
    return pixels


def _bytes_of(array: numpy.ndarray, name: str) -> numpy.ndarray:
    """An array of bytes; real numbers from 0 to 1 are rounded to them."""
    if array.dtype == numpy.uint8:
        return array
    if array.dtype == numpy.bool_:
        return array.astype(numpy.uint8) * 255
    if not numpy.issubdtype(array.dtype, numpy.floating):
        raise ValueError(f"{name}: is of {array.dtype}, and needs uint8, or real numbers from 0 to 1")
    if array.size and not (numpy.nanmin(array) >= 0 and numpy.nanmax(array) <= 1 and not numpy.isnan(array).any()):
        raise ValueError(f"{name}: real numbers must be 0 to 1")
    return numpy.rint(array * 255).astype(numpy.uint8)
