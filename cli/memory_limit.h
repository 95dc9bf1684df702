// What --memory leaves for the images of a sequence that is denoised.
#pragma once

#include <algorithm>
#include <cstddef>

namespace fathom::cli {

// An image as it is read and in the denoiser's scratch (2), the next one, and the last one as it is written; with errors to
// estimate, the noisy one, one that is moved along its noise, and two more as that is denoised.
inline constexpr size_t kImagesInMemory = 4, kImagesWithErrors = 8;
inline size_t imagesInMemory(bool errors) {
  return errors ? kImagesWithErrors : kImagesInMemory;
}
// The program, its libraries, and what a plan itself takes.
inline constexpr size_t kProgramBytes = 200'000'000;

// Bytes that images and guides may take, so that the run stays within `memory`; and back.
inline size_t workingBytes(size_t memory) {
  return memory > 2 * kProgramBytes ? memory - kProgramBytes : memory / 2;
}
inline size_t memoryFor(size_t working) {
  return working + std::min(working, kProgramBytes);
}

// A limit that suffices for work that takes `bytes(limit)`, from a `memory` that may not: libraries take more where they may.
template <class Bytes>
size_t memoryThatSuffices(size_t memory, const Bytes& bytes) {
  constexpr int kMostSteps = 64;  // each takes a quarter of what the last one added
  for (int step = 0; step < kMostSteps; ++step) {
    const size_t needed = memoryFor(bytes(memory));
    if (needed <= memory) break;
    memory = needed;
  }
  return memory;
}

// Bytes that one of the images may take when it is decoded.
inline size_t decodedLimit(size_t memory) {
  return workingBytes(memory) / kImagesInMemory;
}

// Bytes that Open Image Denoise takes beside an image, which it works on in tiles where it is told to stay below
// `scratch`. Measured.
inline size_t oidnBytes(size_t pixels, size_t scratch) {
  constexpr size_t kLeast = 400'000'000, kPixel = 700;
  return std::min(std::max(scratch, kLeast), pixels * kPixel);
}

// Bytes that a mix of denoised images takes beside the images, but for its network: what is known of each, and what the last
// one's errors are estimated in.
inline size_t mixBytes(size_t pixels, size_t candidates) {
  constexpr size_t kCandidate = 72, kEstimate = 300;
  return pixels * (candidates * kCandidate + kEstimate);
}

}  // namespace fathom::cli
