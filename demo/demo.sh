#!/usr/bin/env bash
# The demo: ./run demo builds `fathom` and calls this with its path. Each command is shown as it could be typed.
set -euo pipefail
fathom=$1
out=out/demo
frame=0002
rm -rf "$out"
mkdir -p "$out"

say() { printf '\n\033[1m%s\033[0m\n' "$*"; }
run() {
  echo "\$ fathom $*"
  "$fathom" "$@"
}

say "What is in a noisy deep frame"
run info "demo/sequence.$frame.deep.exr"

say "Denoise the sequence; flattened frames are written beside the deep ones"
run denoise demo/sequence.####.deep.exr -o "$out/sequence.####.deep.exr" --flat "$out/sequence.####.exr"

say "The error before and after, flattened, over the sequence (the reference's own noise subtracted)"
run compare demo/sequence.####.deep.exr demo/sequence.####.ref.exr --correct
run compare "$out/sequence.####.deep.exr" demo/sequence.####.ref.exr --correct

say "The same bin by bin, and in front of and behind a clip plane"
run compare "demo/sequence.$frame.deep.exr" "demo/sequence.$frame.deepref.exr" --clip median
run compare "$out/sequence.$frame.deep.exr" "demo/sequence.$frame.deepref.exr" --clip median

say "Pictures: noisy, denoised, reference"
run png "demo/sequence.$frame.deep.exr" "$out/sequence.$frame.deep.exr" "demo/sequence.$frame.ref.exr" \
  --labels noisy,denoised,reference --zoom 2 --exposure -0.7 -o "$out/frame.png"
run png "demo/sequence.$frame.deep.exr" "$out/sequence.$frame.deep.exr" "demo/sequence.$frame.deepref.exr" --clip 0,7 \
  --labels noisy,denoised,reference --zoom 2 --exposure -0.7 -o "$out/clipped.png"

say "Smoke goes into the denoised frames: among the steps, and farther back. Nothing is rendered again, nothing held out"
run comp "$out/sequence.####.deep.exr" demo/smoke.####.deep.exr --insert --flatten -o "$out/smoke.####.exr"
run comp "$out/sequence.####.deep.exr" demo/smoke.####.deep.exr --insert z=2.5 --flatten -o "$out/smoke-behind.####.exr"
run png "demo/sequence.$frame.deep.exr" "$out/sequence.$frame.deep.exr" "$out/smoke.$frame.exr" "$out/smoke-behind.$frame.exr" \
  --labels noisy,denoised,smoke,"smoke 2.5 farther" --zoom 2 --exposure -0.7 -o "$out/smoke.png"
run png "$out"/smoke.000[123].exr --zoom 2 --exposure -0.7 -o "$out/smoke-frames.png"

cat <<TEXT

The pictures: $out/frame.png; $out/clipped.png with everything behind a depth of 7 taken away; $out/smoke.png with the smoke at
two depths, and $out/smoke-frames.png with all three frames of it.
Next:
  build/bin/fathom-view $out/sequence.####.deep.exr demo/sequence.####.ref.exr
                                                               the result beside the reference; slide a clip plane through it
  build/bin/fathom info YOUR.exr                               what the denoiser would use of it, and what is missing
  build/bin/fathom denoise YOUR.####.exr -o CLEAN.####.exr     a sequence of your own
  build/bin/fathom denoise --help                              quality, memory, inputs in pieces, other channel names
  build/bin/fathom comp --help                                 merge, holdout, clip, fog, grade, ids and what else can be chained
docs/channels.md tells what to ask your renderer for.
TEXT
