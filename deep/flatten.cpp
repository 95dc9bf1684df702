// Which sample contributes how much to a pixel is decided once per row of the image; the channels are then sums over
// that.
#include "deep/flatten.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "deep/channels.h"
#include "deep/flat_attributes.h"
#include "deep/pixel_pieces.h"
#include "flat/parallel.h"

namespace fathom::deep {

namespace {

// How one row's pixels are made of its samples.
struct RowWeights {
  std::vector<double> premultiplied;  // per sample, the factor of premultiplied values
  std::vector<double> plain;          // per sample, the factor of other values: its part of what is seen of the pixel
  std::vector<float> alpha, z;        // per pixel
};

// What compositing pieces front to back adds up.
struct Pixel {
  double passed = 1;  // transmittance so far
  double alpha = 0;
  double depth = 0, depthAlpha = 0;  // of the pieces at a finite depth
  float nearest = std::numeric_limits<float>::infinity();

  // Returns the transmittance in front of the piece.
  double put(const Range& range, double pieceAlpha) {
    const double front = passed, seen = front * pieceAlpha, middle = range.middle();
    nearest = std::min(nearest, range.z);
    alpha += seen;
    if (std::isfinite(middle)) {
      depth += seen * middle;
      depthAlpha += seen;
    }
    passed *= 1 - pieceAlpha;
    return front;
  }
  float z() const { return depthAlpha > 0 ? float(depth / depthAlpha) : nearest; }
};

struct Source {
  const DeepImage& image;
  std::span<const float> alpha, z, zBack;
  bool mergePoints;

  std::span<const float> of(std::span<const float> values, size_t pixel) const {
    return values.empty() ? values : values.subspan(image.offsets[pixel], image.count(pixel));
  }
};

// Composites the pixel whose samples start at `first` in the row.
void decide(const Source& source, size_t pixel, size_t first, PixelPieces& pieces, RowWeights& row) {
  const std::span<const float> alpha = source.of(source.alpha, pixel);
  pieces.set(source.of(source.z, pixel), source.of(source.zBack, pixel));
  checkOverlaps(pieces.size(source.mergePoints), source.image.dataWindow, pixel);
  Pixel sum;
  pieces.visit(alpha, source.mergePoints, [&](const Piece& piece) {
    const double front = sum.put(piece.range, piece.alpha);
    for (const Share& share : piece.shares) {
      row.premultiplied[first + share.sample] += front * share.weight;
      row.plain[first + share.sample] += front * piece.alpha * share.part;
    }
  });
  for (size_t i = first; i < first + alpha.size(); ++i) row.plain[i] = sum.alpha > 0 ? row.plain[i] / sum.alpha : 0;
  row.alpha.push_back(float(sum.alpha));
  row.z.push_back(alpha.empty() ? 0 : sum.z());
}

RowWeights decideRow(const Source& source, size_t firstPixel, size_t endPixel) {
  const DeepImage& image = source.image;
  const size_t begin = image.offsets[firstPixel], samples = image.offsets[endPixel] - begin;
  RowWeights row{std::vector<double>(samples), std::vector<double>(samples), {}, {}};
  PixelPieces pieces;
  for (size_t pixel = firstPixel; pixel < endPixel; ++pixel)
    decide(source, pixel, image.offsets[pixel] - begin, pieces, row);
  return row;
}

// `offsets` are those of the row's pixels.
void apply(const std::vector<double>& weights, const uint64_t* offsets, std::span<const float> values,
           std::span<float> out) {
  for (size_t x = 0; x < out.size(); ++x) {
    double sum = 0;
    for (size_t i = offsets[x]; i < offsets[x + 1]; ++i)
      sum += weights[i - offsets[0]] * double(finiteOrZero(values[i]));
    out[x] = float(sum);
  }
}

bool hasFlatForm(const Channel& channel) {
  const Role role = roleOf(channel);
  return role != Role::Statistic && role != Role::Identifier && channel.name != "ZBack";
}

}  // namespace

flat::Image flatten(const DeepImage& image) {
  const Source source{image, image.get("A"), image.get("Z"), image.tryGet("ZBack"), !holdsStatistics(image)};
  flat::Image result{image.dataWindow, image.displayWindow, {}, flatAttributes(image.attributes)};
  std::vector<const Channel*> channels;
  for (const Channel& channel : image.channels)
    if (hasFlatForm(channel)) {
      channels.push_back(&channel);
      result.add(channel.name);
    }
  const size_t width = size_t(image.dataWindow.width());
  parallelFor(0, image.dataWindow.height(), [&](int y) {
    const size_t first = size_t(y) * width;
    const RowWeights row = decideRow(source, first, first + width);
    for (size_t c = 0; c < channels.size(); ++c) {
      const std::span<float> out{result.planes[c].values.data() + first, width};
      const Role role = roleOf(*channels[c]);
      if (role == Role::Alpha)
        std::copy(row.alpha.begin(), row.alpha.end(), out.begin());
      else if (role == Role::Depth)
        std::copy(row.z.begin(), row.z.end(), out.begin());
      else
        apply(role == Role::Plain ? row.plain : row.premultiplied, image.offsets.data() + first, channels[c]->values,
              out);
    }
  });
  return result;
}

}  // namespace fathom::deep
