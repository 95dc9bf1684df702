// The mixing network's planes against those of its training (tests/flat/mix_frames.py made the file), and laws of theirs.
#include "flat/mix_planes.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "nn/weights.h"
#include "tests/reference/noisy_flat.h"

namespace fathom::flat {
namespace {

const nn::WeightFile& stored() {
  static const nn::WeightFile file = nn::readWeights(FATHOM_MIX_PLANES);
  return file;
}

Image storedImage(const std::string& beginning) {
  Image image;
  for (const auto& [tensor, values] : stored().tensors) {
    if (!tensor.starts_with(beginning)) continue;
    image.dataWindow = image.displayWindow = {4, -2, 4 + int(values.shape[1]), -2 + int(values.shape[0])};
    image.planes.push_back({tensor.substr(beginning.size()), values.values.copy()});
  }
  return image;
}

Candidate storedCandidate(const std::string& name, const std::string& base) {
  const Image image = storedImage(fmt::format("{}/candidate/{}.", name, base));
  Candidate candidate{{image.dataWindow, image.displayWindow, {}, {}}, {}, {}, {}};
  for (size_t c = 0; c < 3; ++c) {
    const std::string channel = kRgbNames[c];
    candidate.denoised.add(channel).values = image.get(channel).values.copy();
    candidate.map.error[c] = image.get("error." + channel).values.copy();
    candidate.map.variance[c] = image.get("variance." + channel).values.copy();
    candidate.map.covariance[c] = image.get("covariance." + channel).values.copy();
    candidate.spread[c] = image.get("spread." + channel).values.copy();
  }
  candidate.k = image.get("gate").values.copy();
  return candidate;
}

std::vector<Candidate> storedCandidates(const std::string& name) {
  std::vector<Candidate> candidates;
  for (const char* base : {"nlm", "oidn"}) candidates.push_back(storedCandidate(name, base));
  return candidates;
}

// Of a window that goes beyond the frame, where the last pixels are repeated.
void expectPlanes(const std::function<void(const nn::Window&, const nn::Planes&)>& fill, const nn::Tensor& expected) {
  const int planes = int(expected.shape[0]), height = int(expected.shape[1]), width = int(expected.shape[2]);
  const nn::Window window{4, 0, 8, 8};
  std::vector<float> found(size_t(planes) * 64, -99.0f);
  fill(window, nn::denseRows(found.data(), planes, window.height, window.width));
  for (int p = 0; p < planes; ++p)
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x) {
        const size_t i = (size_t(p) * size_t(height) + size_t(std::min(y, height - 1))) * size_t(width) +
                         size_t(std::min(window.x + x, width - 1));
        const float e = expected.values[i];
        ASSERT_NEAR(found[size_t((p * 8 + y) * 8 + x)], e, 1e-5f + 1e-5f * std::abs(e))
            << "plane " << p << ", " << x << " " << y;
      }
}

TEST(MixPlanes, EqualTraining) {
  for (const std::string name : {"full", "samples", "light"}) {
    SCOPED_TRACE(name);
    Image noisy = storedImage(fmt::format("{}/in/", name));
    noisy.attributes.emplace("fathom:spp", "8");
    const Noise noise = noiseOf(noisy);
    const std::vector<Candidate> candidates = storedCandidates(name);
    const nn::MixSource source = mixSource(noisy, noise, candidates);
    ASSERT_EQ(source.candidates, 2);
    expectPlanes(source.shared, stored().tensors.at(fmt::format("{}/shared", name)));
    for (int n = 0; n < 2; ++n)
      expectPlanes([&](const nn::Window& window, const nn::Planes& to) { source.own(n, window, to); },
                   stored().tensors.at(fmt::format("{}/own/{}", name, n ? "oidn" : "nlm")));
  }
}

TEST(MixPlanes, AreFiniteWhateverStandsThere) {
  Image noisy = storedImage("full/in/");
  std::vector<Candidate> candidates = storedCandidates("full");
  const float odd[] = {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -3e38f, 3e38f};
  for (size_t p = 0; p < noisy.planes.size(); ++p)
    for (size_t i = 0; i < 4; ++i) noisy.planes[p].values[(7 * p + i) % 60] = odd[i];
  for (size_t c = 0; c < 3; ++c)
    for (size_t i = 0; i < 4; ++i) {
      candidates[0].denoised.planes[c].values[11 * c + i] = odd[i];
      candidates[0].map.error[c][11 * c + i] = 1e15f;
    }
  const Noise noise = noiseOf(noisy);
  const nn::MixSource source = mixSource(noisy, noise, candidates);
  std::vector<float> found(size_t(nn::kMixShared) * 8 * 12);
  source.shared({0, 0, 12, 8}, nn::denseRows(found.data(), nn::kMixShared, 8, 12));
  for (const float v : found) ASSERT_TRUE(std::isfinite(v));
  source.own(0, {0, 0, 12, 8}, nn::denseRows(found.data(), nn::kMixOwn, 8, 12));
  for (const float v : found) ASSERT_TRUE(std::isfinite(v));
}

}  // namespace
}  // namespace fathom::flat
