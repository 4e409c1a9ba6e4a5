# shellcheck shell=bash disable=SC2154
# What the plug-in does in a window of GIMP 3: `run` sources this. xdotool is the person's hands. What is looked at is
# the title of GIMP's window, which tells the number of layers.

# Waits up to a minute until a command succeeds: within_a_minute WHAT COMMAND...
within_a_minute() {
    local what="$1"
    shift
    for _ in {1..240}; do
        if "$@" >/dev/null 2>&1; then
            echo "ok - $what"
            return
        fi
        sleep 0.25
    done
    picture failed
    fail "not within a minute: $what; GIMP said:
$(tail -n 20 "$room/window.log")"
}

has_title() { xdotool search --onlyvisible --name "$1"; }
# The arguments that the program evolves with.
evolving() { pgrep -a -f "^/room/smalti evolve - " | cut -d ' ' -f 3-; }
evolves_with() { [[ " $(evolving) " == *" $1 "* ]]; }
nothing_evolves() { [[ -z "$(evolving)" ]]; }
plug_in_is_gone() { ! pgrep -f "/plug-ins/smalti/smalti.py -gimp"; }
picture() { [[ -z $shots ]] || import -window root "$shots/gimp3-$1.png"; }

# Finds the plug-in by its name, as a person may, and waits for its settings.
open_settings() {
    xdotool windowactivate --sync "$window"
    xdotool key slash
    within_a_minute "the search for a command opens" has_title "Search Actions"
    xdotool type --delay 80 smalti
    sleep 1.5
    xdotool key Return
    within_a_minute "the settings open" has_title "smalti: lay the picture in tiles"
    sleep 1
}

Xvfb -displayfd 8 -screen 0 1100x800x24 8>"$room/display" 2>/dev/null &
helpers=($!)
trap 'kill "${helpers[@]}" 2>/dev/null || true; wait; rm -rf "$room"' EXIT
within_a_minute "there is a display" test -s "$room/display"
DISPLAY=":$(cat "$room/display")"
export DISPLAY
openbox >/dev/null 2>&1 &
helpers+=($!)
# Without the docks, the button that cancels is in the window's lower right corner.
printf '(hide-docks yes)\n(single-window-mode yes)\n' >"$settings/sessionrc"
"${in_root[@]}" gimp-3.0 --no-splash --batch-interpreter=python-fu-eval -b "exec(open('/room/look.py').read())" \
    >"$room/window.log" 2>&1 &
helpers+=($!)
within_a_minute "GIMP shows a photo of one layer" has_title ", 1 layer)"
window="$(has_title ", 1 layer)")"
xdotool windowsize --sync "$window" 700 500

open_settings
xdotool key alt+n type --delay 40 150
xdotool key alt+f type --delay 40 30000
xdotool key Tab
sleep 1
picture settings
xdotool key alt+o
within_a_minute "there is a second layer" has_title ", 2 layers)"
sleep 1
picture mosaic
xdotool windowactivate --sync "$window" key ctrl+z
within_a_minute "one step of undo takes it away" has_title ", 1 layer)"

open_settings
xdotool key alt+f type --delay 40 2000000000
xdotool key Tab
sleep 1
xdotool key alt+o
within_a_minute "the values of the last time are remembered" evolves_with "--tiles 150"
sleep 3
picture progress
eval "$(xdotool getwindowgeometry --shell "$window")"
xdotool mousemove --window "$window" $((WIDTH - 45)) $((HEIGHT - 18)) click 1
within_a_minute "a click on Cancel ends the program" nothing_evolves
within_a_minute "and the plug-in" plug_in_is_gone
sleep 1
within_a_minute "and nothing has changed" has_title ", 1 layer)"
picture cancelled

ln -sf nowhere "$room/smalti"
xdotool windowactivate --sync "$window" key slash
within_a_minute "the search for a command opens" has_title "Search Actions"
xdotool type --delay 80 smalti
sleep 1.5
xdotool key Return
within_a_minute "a missing program is told in a window of its own" has_title "GIMP Message"
picture refusal
[[ -z "$(find "$room/tmp" -type f)" ]] || fail "files are left: $(find "$room/tmp" -type f)"
