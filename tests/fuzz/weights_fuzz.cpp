// Any bytes as a weight file: tensors or an Error, and a network from them or one too.
#include <cstdint>
#include <span>

#include "nn/compositional.h"
#include "nn/layers.h"
#include "nn/mix.h"
#include "tests/fuzz/expect.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  fuzz::mayFail([&] {
    const nn::WeightFile file = nn::readWeights(std::as_bytes(std::span(data, size)), "input");
    for (const auto& [name, tensor] : file.tensors) {
      size_t count = 1;
      for (const int64_t n : tensor.shape) count *= size_t(n);
      fuzz::expect(count == tensor.values.size(), "as many values as the shape has");
    }
    fuzz::mayFail([&] { const nn::CompositionalNet net(file); });
    fuzz::mayFail([&] { const nn::MixNet net(file); });
    fuzz::mayFail([&] { const nn::LayersNet net(file); });
  });
  return 0;
}
