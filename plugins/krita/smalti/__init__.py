"""Krita's Filter menu turns a layer into a mosaic. The work is done by the program smalti, which runs beside Krita."""

from krita import Krita

from .extension import SmaltiExtension

Krita.instance().addExtension(SmaltiExtension(Krita.instance()))
