#!/bin/sh
# The command itself as one more peer of the comparison's film (W5): video to the confirmed tracks' positions, a table of frame, id, x, y.
# Usage: film.sh CORES VIDEO OUT.npy [options of `boresight track`]; BORESIGHT names the program, else target/release/boresight of this repository.
# The table is made within the time that counts; beside `track` it is some 30 ms in all.
set -e
cores=$1 video=$2 out=${3%.npy}
shift 3
program=${BORESIGHT:-$(dirname "$0")/../../target/release/boresight}
rm -rf "$out.run"
taskset -c "$cores" "$program" track "$video" -q -o "$out.run" "$@"
taskset -c "$cores" awk -F, 'NR == 1 { print "frame,id,x,y" } NR > 1 && $4 != "tentative" { print $1 "," $3 "," $5 "," $6 }' "$out.run/tracks.csv" > "$out.csv"
