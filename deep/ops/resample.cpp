#include "deep/ops/resample.h"

#include "deep/ops/area_mean.h"
#include "deep/tidy.h"

namespace fathom::deep {

namespace {

// As an AreaMean takes it.
DeepImage prepared(DeepImage image) {
  image = tidy(std::move(image)).image;
  dropSampleStatistics(image);
  for (const char* name : {"fathom:spp", "deepImageState"}) image.attributes.erase(name);
  return image;
}

}  // namespace

Box resampledWindow(const Box& window, const Resampling& how) {
  const Extent x = resultOf(how.columns, {window.x0, window.x1}), y = resultOf(how.rows, {window.y0, window.y1});
  return {x.begin, y.begin, x.end, y.end};
}

DeepImage resample(DeepImage image, const Resampling& how) {
  const Box from = image.dataWindow, window = resampledWindow(from, how);
  const DeepImage source = how.mixes() ? prepared(std::move(image)) : std::move(image);
  const Cover columns(how.columns, how.filter, {from.x0, from.x1}, {window.x0, window.x1});
  const Cover rows(how.rows, how.filter, {from.y0, from.y1}, {window.y0, window.y1});
  std::vector<RowPlan> plans(size_t(window.height()));
  parallelFor(window.y0, window.y1, [&](int y) {
    AreaMean mean(source, how.tolerance);
    std::vector<PixelShare> pixels;
    const std::span<const double> down = rows.weights(y);
    for (int x = window.x0; x < window.x1; ++x) {
      const std::span<const double> across = columns.weights(x);
      pixels.clear();
      for (size_t i = 0; i < down.size(); ++i)
        for (size_t k = 0; k < across.size(); ++k)
          pixels.push_back({from.index(columns.first(x) + int(k), rows.first(y) + int(i)), down[i] * across[k]});
      mean.add(pixels, plans[size_t(y - window.y0)]);
    }
  });
  return applyPlan(source, window, plans);
}

}  // namespace fathom::deep
