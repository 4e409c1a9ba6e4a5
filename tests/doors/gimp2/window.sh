# shellcheck shell=bash disable=SC2154
# The dialog, worked by keys on a display that nobody sees. Part of `run`: it makes a mosaic, undoes it in one step, and
# cancels another. GIMP tells by window.scm how many layers there are.

display="${DISPLAY_NUMBER:-:32}"
Xvfb "$display" -screen 0 1280x900x24 >/dev/null 2>&1 &
background+=($!)
export DISPLAY="$display"
until_so xdotool getdisplaygeometry >/dev/null 2>&1 ||
    fail "Xvfb does not start on $display; name another in DISPLAY_NUMBER"
openbox >/dev/null 2>&1 &
background+=($!)
echo '(gtk_accel_path "<Actions>/plug-in/plug-in-smalti" "<Primary><Shift>m")' >"$XDG_CONFIG_HOME/GIMP/2.10/menurc"
echo real >kind
rm -f slow-program slow-plug-in
gimp-2.10 -d -f -s -n -b "(begin (define scratch \"$SCRATCH\") (load \"$here/window.scm\"))" rgb.png \
    >window.log 2>&1 </dev/null &
background+=($!)

window_named() { xwininfo -root -tree | sed -n "s/^ *\(0x[0-9a-f]*\) \"[^\"]*$1.*/\1/p" | head -n 1; }
has_window() { [[ -n "$(window_named "$1")" ]]; }
layers_are() { [[ "$(cat layers 2>/dev/null)" == "$1" ]]; }
images_are() { [[ "$(cat images 2>/dev/null)" == "$1" ]]; }
# The file is written again and again, and may be half there.
is_shown() { [[ "$(pixels shown.png 2>/dev/null)" == "$(pixels "$1")" ]]; }
press() { xdotool key --delay 60 "$@"; }
enter() { # mnemonic of a field, text
    press "alt+$1" ctrl+a
    xdotool type "$2"
}
to_image() { xdotool windowfocus --sync "$(window_named imported)" && sleep 0.5; }
photograph() { [[ -z "${SHOTS:-}" ]] || import -window root "$SHOTS/gimp2-$1.png"; }
step() { # what, command that says yes in the end
    if until_so "${@:2}"; then passes "$1"; else photograph failure && fails "$1" "not within a minute"; fi
}
open_dialog() {
    to_image
    press ctrl+shift+m
    step "$1" has_window "Mosaic of Tiles"
    sleep 0.5
}

step "GIMP shows the picture" layers_are 1
until_so has_window imported || fail "GIMP has no window: $(cat window.log)"
sleep 2
open_dialog "the dialog opens"
photograph dialog
enter n 999
enter a 3
press alt+r
enter n 60
enter e 6000
enter d 7
press Return
step "the dialog makes a layer" layers_are 2
step "with the pixels that the program writes for what was entered" is_shown rgb-wanted.png
photograph result
to_image
press ctrl+z
step "one undo takes it back" layers_are 1
step "and shows the picture again" is_shown rgb.png
press ctrl+f
step "the filter repeated makes the same again" layers_are 2
step "with the last values" is_shown rgb-wanted.png
press ctrl+z
step "and it goes again" layers_are 1

open_dialog "the dialog opens for another"
press alt+l Return
step "it remembers its values, and replaces pixels if told to" is_shown rgb-wanted.png
is "in the same layer" "$(cat layers)" 1
to_image
press ctrl+z
step "one undo brings them back" is_shown rgb.png

# Another with so much effort that it does not end before it is cancelled.
echo slow >kind
open_dialog "the dialog opens for a long one"
enter e 2000000000
press Return
step "the program runs" test -s slow-program
sleep 2
photograph progress
# The button in the status bar, in a window of a fresh GIMP.
xdotool mousemove --window "$(window_named imported)" 785 750
sleep 0.3
xdotool click 1
step "a click on Cancel ends the plug-in" is_gone "$(cat slow-plug-in)"
step "and the program with it" is_gone "$(cat slow-program)"
is "nothing is changed" "$(cat layers)" 1
sleep 1
photograph cancelled

# A scale makes an image, which is shown.
echo real >kind
open_dialog "the dialog opens for a new image"
enter e 6000
enter a 2.00
press Return
step "a scale makes a new image" images_are 2
step "and shows it" has_window "192x144"
is "beside the old one" "$(cat layers)" 1
photograph scaled

# What the plug-in refuses, GIMP shows.
echo failing >kind
open_dialog "the dialog opens for a program that fails"
press Return
step "GIMP shows the sentence of a failure" has_window "GIMP Message"
photograph refusal
