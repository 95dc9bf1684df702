// Images whose channels lie in groups, [group][y][x][channel of the group], as oneDNN's convolutions want them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "nn/planes.h"

namespace fathom::nn {

enum class Element { float32, bfloat16 };

inline size_t bytesOf(Element element) {
  return element == Element::float32 ? 4 : 2;
}

// How many values lie where, in pixels.
struct Window {
  int x = 0, y = 0, width = 0, height = 0;

  bool operator==(const Window&) const = default;
};

// Rounds to the nearest, halves to the even one. `from` is finite.
void toBfloat16(const float* from, size_t count, uint16_t* to);

// Planes to groups of `block` (8 or 16); what the last group has more than there are planes becomes 0.
void packPlanes(const ConstPlanes& from, int height, int width, int block, Element element, std::byte* to);

// Of a count of values in either type.
void toElements(const float* from, size_t count, Element element, std::byte* to);
void toFloats(const std::byte* from, size_t count, Element element, float* to);

// One window of [groups][height][width] pixels of `pixelBytes` bytes, without gaps.
void cropGroups(const std::byte* from, size_t groups, int height, int width, size_t pixelBytes, const Window& window,
                std::byte* to);

// A window of `from`, [groups][height][width] pixels, to the place of one as large in `to`, [groups][toHeight][toWidth].
void pasteGroups(const std::byte* from, size_t groups, int height, int width, size_t pixelBytes, const Window& window,
                 std::byte* to, int toHeight, int toWidth, int x, int y);

// Every pixel four times: [groups][height][width] to [groups][2 height][2 width]. `pixelBytes` is 16, 32 or 64.
void enlargeGroups(const std::byte* from, size_t groups, int height, int width, size_t pixelBytes, std::byte* to);

}  // namespace fathom::nn
