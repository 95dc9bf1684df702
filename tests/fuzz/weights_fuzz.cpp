// Any bytes as a weight file: tensors or an Error of one line, and a network from them or one too.
//
// The entry point is libFuzzer's; driver.cpp runs it where that is not at hand.
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

#include "base/error.h"
#include "nn/compositional.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace fathom;
  try {
    const nn::WeightFile file = nn::readWeights(std::as_bytes(std::span(data, size)), "input");
    for (const auto& [name, tensor] : file.tensors) {
      size_t count = 1;
      for (const int64_t n : tensor.shape) count *= size_t(n);
      if (count != tensor.values.size()) std::abort();
    }
    const nn::CompositionalNet net(file);
  } catch (const Error& e) {
    if (std::string(e.what()).find('\n') != std::string::npos) std::abort();
  }
  return 0;
}
