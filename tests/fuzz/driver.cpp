// Runs a fuzzer's entry point without libFuzzer: on the files given as they are, then on changed copies of them.
//
//   fuzz_NAME [--runs N] [--seed N] FILE...
//
// The input at work lies in fuzz-input.bin while it runs, so that a crash leaves it there.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size);

namespace {

using Bytes = std::vector<uint8_t>;

Bytes load(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

void run(const Bytes& bytes) {
  std::remove("fuzz-input.bin");
  std::ofstream("fuzz-input.bin", std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
}

class Mutator {
 public:
  explicit Mutator(unsigned seed) : random_(seed) {}

  size_t below(size_t n) { return n == 0 ? 0 : size_t(random_() % n); }

  Bytes change(Bytes bytes) {
    for (size_t n = 1 + below(4); n > 0 && !bytes.empty(); --n) changeOnce(bytes);
    return bytes;
  }

 private:
  // Headers and tables stand in front and decide much: a quarter of all changes fall there.
  size_t place(size_t size) { return below(4) ? below(size) : below(size < 4096 ? size : 4096); }

  void changeOnce(Bytes& bytes) {
    const size_t at = place(bytes.size());
    switch (below(6)) {
      case 0:
        bytes[at] ^= uint8_t(1u << below(8));
        break;
      case 1:
        bytes[at] = uint8_t(random_());
        break;
      case 2:
        putInteger(bytes, at);
        break;
      case 3:
        bytes.resize(at);
        break;
      case 4:
        bytes.erase(bytes.begin() + ptrdiff_t(at), bytes.begin() + ptrdiff_t(at + below(bytes.size() - at) % 64));
        break;
      default:
        copyBlock(bytes, at);
        break;
    }
  }

  void putInteger(Bytes& bytes, size_t at) {
    static constexpr uint64_t kOdd[] = {0,
                                        1,
                                        127,
                                        255,
                                        32767,
                                        65536,
                                        0x7fffffff,
                                        0x80000000,
                                        0xffffffff,
                                        uint64_t(1) << 40,
                                        uint64_t(1) << 63,
                                        ~uint64_t(0)};
    const uint64_t value = kOdd[below(std::size(kOdd))];
    const size_t size = below(2) ? 4 : 8;
    std::memcpy(bytes.data() + at, &value, std::min(size, bytes.size() - at));
  }

  void copyBlock(Bytes& bytes, size_t at) {
    const size_t from = below(bytes.size());
    const size_t n = std::min({below(256), bytes.size() - at, bytes.size() - from});
    std::memmove(bytes.data() + at, bytes.data() + from, n);
  }

  std::mt19937_64 random_;
};

}  // namespace

int main(int argc, char** argv) {
  unsigned seed = 1;
  long runs = 1000;
  std::vector<Bytes> inputs;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    if (argument == "--runs" && i + 1 < argc)
      runs = std::atol(argv[++i]);
    else if (argument == "--seed" && i + 1 < argc)
      seed = unsigned(std::atol(argv[++i]));
    else
      inputs.push_back(load(argument));
  }
  if (inputs.empty()) return std::fprintf(stderr, "usage: %s [--runs N] [--seed N] FILE...\n", argv[0]), 2;
  for (const Bytes& input : inputs) run(input);
  Mutator mutator(seed);
  for (long i = 0; i < runs; ++i) run(mutator.change(inputs[mutator.below(inputs.size())]));
  std::remove("fuzz-input.bin");
  std::printf("%zu files and %ld changed copies of them: no crash\n", inputs.size(), runs);
  return 0;
}
