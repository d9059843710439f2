#!/usr/bin/env bash
# Makes the clips of this folder with ffmpeg (5.1 with libx264 and libx265 was used). The reference table comes from
#   cargo xtask video-check --reference crates/boresight/tests/data/video/*.m* > crates/boresight/tests/data/video/reference.txt
# The pictures are ffmpeg's own test pattern; they carry no licence of anybody else.
set -euo pipefail
cd "$(dirname "$0")"
ff() { ffmpeg -hide_banner -loglevel error -nostdin -y "$@"; }
src=(-f lavfi -i testsrc2=s=64x48:r=25:d=1)
x264=(-an -c:v libx264 -threads 1 -bitexact -preset veryfast)
x=("${x264[@]}" -crf 32)
ff "${src[@]}" "${x[@]}" -profile:v high -bf 3 -x264-params "b-pyramid=normal:keyint=12:min-keyint=12" b_frames.mp4
ff "${src[@]}" "${x[@]}" -bf 2 -x264-params "open-gop=1:keyint=8:min-keyint=8:scenecut=0" open_gop.mp4
ff "${src[@]}" "${x[@]}" -bf 2 -vf "select='not(mod(n,3))+not(mod(n,7))',setpts=PTS+0.003*mod(N\,4)/TB" -fps_mode vfr \
    -video_track_timescale 90000 variable_rate.mp4
ff -ss 0.3 -i b_frames.mp4 -c copy -bitexact edit_list.mp4
ff "${src[@]}" "${x[@]}" -bf 2 -output_ts_offset 0.5 start_offset.mp4
ff "${src[@]}" "${x[@]}" -bf 2 -g 10 -movflags frag_keyframe+empty_moov+default_base_moof fragmented.mp4
ff "${src[@]}" "${x[@]}" -bf 2 -g 10 -movflags frag_keyframe -output_ts_offset 0.7 fragmented_offset.mp4
ff "${src[@]}" "${x[@]}" -pix_fmt yuv420p10le -bf 2 ten_bit.mp4
ff "${src[@]}" "${x[@]}" -flags +ildct+ilme -x264-params tff=1 -bf 2 interlaced.mp4
ff -f lavfi -i testsrc2=s=62x46:r=30000/1001:d=0.8 "${x[@]}" -bf 2 cropped.mp4
ff "${src[@]}" "${x[@]}" -pix_fmt yuv422p -bf 2 yuv422.mp4
ff "${src[@]}" "${x[@]}" -bf 2 -movflags negative_cts_offsets negative_offsets.mp4
ff "${src[@]}" -f lavfi -i testsrc=s=80x64:r=10:d=1 "${x[@]}" -map 0 -map 1 -bf 2 two_tracks.mp4
ff "${src[@]}" "${x[@]}" -bf 2 quicktime.mov
ff "${src[@]}" "${x[@]}" -pix_fmt gray -bf 2 grey.mp4
ff "${src[@]}" "${x[@]}" -profile:v baseline -x264-params "slices=3:ref=4" slices.mp4
# These three are read through ffmpeg.
ff "${src[@]}" "${x[@]}" -pix_fmt yuv444p -bf 2 yuv444.mp4
ff "${src[@]}" "${x264[@]}" -qp 0 lossless.mp4
ff "${src[@]}" -an -c:v libx265 -x265-params log-level=none -bitexact hevc.mp4
