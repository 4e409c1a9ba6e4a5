#!/usr/bin/python3
"""Reads a RenderDoc capture of smalti without a window (Debian: python3-renderdoc, for the system's Python).

read_capture.py CAPTURE.rdc                     the passes of each submission, and the named buffers
read_capture.py CAPTURE.rdc BUFFER [COUNT]      also the first COUNT words (8) of a buffer after each dispatch or draw
"""

import struct
import sys

import renderdoc as rd


def walk(actions, structured, passes=()):
    """The dispatches and draws, each with the label of its pass."""
    for action in actions:
        if action.flags & (rd.ActionFlags.Dispatch | rd.ActionFlags.Drawcall):
            yield passes[-1] if passes else "", action
        label = (action.GetName(structured),) if action.flags & rd.ActionFlags.PushMarker else ()
        yield from walk(action.children, structured, passes + label)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__.strip())
    rd.InitialiseReplay(rd.GlobalEnvironment(), [])
    capture = rd.OpenCaptureFile()
    opened = capture.OpenFile(sys.argv[1], "", None)
    if opened != rd.ResultCode.Succeeded:
        sys.exit(f"{sys.argv[1]} cannot be opened: {opened}")
    opened, replay = capture.OpenCapture(rd.ReplayOptions(), None)
    if opened != rd.ResultCode.Succeeded:
        sys.exit(f"{sys.argv[1]} cannot be replayed here: {opened}")
    names = {resource.resourceId: resource.name for resource in replay.GetResources()}
    buffers = {names[buffer.resourceId]: buffer for buffer in replay.GetBuffers()}
    watched = None
    if len(sys.argv) > 2:
        if sys.argv[2] not in buffers:
            sys.exit(f"no buffer is named {sys.argv[2]}; there are {', '.join(sorted(buffers))}")
        watched = buffers[sys.argv[2]]
        size = min(watched.length, 4 * int(sys.argv[3] if len(sys.argv) > 3 else 8)) // 4 * 4
    for label, action in walk(replay.GetRootActions(), replay.GetStructuredFile()):
        is_dispatch = action.flags & rd.ActionFlags.Dispatch
        work = "x".join(map(str, action.dispatchDimension)) if is_dispatch else f"{action.numInstances} quads"
        words = ""
        if watched:
            replay.SetFrameEvent(action.eventId, False)
            words = " ".join(str(word) for (word,) in
                             struct.iter_unpack("<I", replay.GetBufferData(watched.resourceId, 0, size)))
        print(f"{action.eventId:6} {label:16} {work:12} {words}".rstrip())
    if not watched:
        for name, buffer in sorted(buffers.items()):
            print(f"buffer {name}: {buffer.length} bytes")
    replay.Shutdown()
    capture.Shutdown()
    rd.ShutdownReplay()


main()
