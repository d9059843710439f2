#!/bin/sh
# The command itself as one more peer of the comparison's film (W5): video to the confirmed tracks' positions, a table of frame, id, x, y.
# Usage: film.sh CORES VIDEO FRAMES OUT.npy [options of `boresight track`]; BORESIGHT names the program, else target/release/boresight of this repository.
# The table is made within the time that counts; the last line says how many frames that was.
set -e
cores=$1 video=$2 frames=$3 out=${4%.npy}
shift 4
program=${BORESIGHT:-$(dirname "$0")/../../target/release/boresight}
rm -rf "$out.run"
taskset -c "$cores" "$program" track "$video" -q -o "$out.run" "$@"
taskset -c "$cores" awk -F, 'NR == 1 { print "frame,id,x,y" } NR > 1 && $4 != "tentative" { print $1 "," $3 "," $5 "," $6 }' "$out.run/tracks.csv" > "$out.csv"
echo "{\"units\": $frames}"
