"""Shows a small photo in GIMP; its python-fu-eval runs this in the room that `run` makes."""

from gi.repository import Gimp, Gio

photo = Gimp.file_load(Gimp.RunMode.NONINTERACTIVE, Gio.File.new_for_path("/room/parrots.png"))
photo.scale(160, 160)
Gimp.Display.new(photo)
