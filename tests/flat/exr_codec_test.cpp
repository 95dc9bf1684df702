// Packed bytes of deep chunks: what is packed unpacks to the same, at every length and from every place.
#include "flat/exr_codec.h"

#include <Imath/half.h>
#include <gtest/gtest.h>

#include <cstring>
#include <random>

#include "base/error.h"

namespace fathom {
namespace {

using Bytes = std::vector<uint8_t>;

constexpr Compression kAll[] = {Compression::None, Compression::Rle, Compression::Zips};

// Bytes with runs in them; `spread` 1 is constant, 256 is noise.
Bytes randomBytes(size_t size, unsigned spread, unsigned seed) {
  std::mt19937 random(seed);
  Bytes bytes(size);
  for (uint8_t& b : bytes) b = uint8_t(random() % spread);
  return bytes;
}

Bytes packed(Compression compression, const Bytes& bytes, size_t rawSize) {
  Bytes result = {1, 2, 3};  // what was there before stays
  Packer().pack(compression, bytes, rawSize, result);
  EXPECT_EQ(Bytes(result.begin(), result.begin() + 3), (Bytes{1, 2, 3}));
  result.erase(result.begin(), result.begin() + 3);
  return result;
}

// memcmp() may not be told of nothing at null, as an empty vector has it.
bool sameBytes(const void* a, const void* b, size_t n) {
  return n == 0 || std::memcmp(a, b, n) == 0;
}

TEST(ExrCodec, EveryLengthComesBack) {
  Unpacker unpacker;
  for (Compression compression : kAll)
    for (unsigned spread : {1u, 2u, 256u})
      for (size_t values = 0; values <= 150; ++values) {
        const Bytes bytes = randomBytes(4 * values, spread, unsigned(values));
        const Bytes file = packed(compression, bytes, bytes.size());
        ASSERT_LE(file.size(), bytes.size());
        std::vector<uint32_t> back(values);
        unpacker.unpack(compression, file, bytes.size(), bytes.size()).copy(0, std::span<uint32_t>(back));
        ASSERT_TRUE(sameBytes(back.data(), bytes.data(), bytes.size())) << values;
      }
}

TEST(ExrCodec, PiecesFromEveryPlace) {
  const Bytes bytes = randomBytes(400, 3, 1);
  for (Compression compression : kAll) {
    const Bytes file = packed(compression, bytes, bytes.size());
    Unpacker unpacker;
    const Unpacked unpacked = unpacker.unpack(compression, file, bytes.size(), bytes.size());
    for (size_t at = 0; at < bytes.size(); at += 2)
      for (size_t n : {size_t(0), size_t(1), size_t(7), (bytes.size() - at) / 4}) {
        if (at + 4 * n > bytes.size()) continue;
        std::vector<float> floats(n), halves(n), expected(n);
        unpacked.copy(at, floats);
        ASSERT_TRUE(sameBytes(floats.data(), bytes.data() + at, 4 * n)) << at;
        unpacked.copyHalf(at, halves);
        for (size_t i = 0; i < n; ++i) {
          uint16_t bits;
          std::memcpy(&bits, bytes.data() + at + 2 * i, 2);
          expected[i] = imath_half_to_float(bits);
        }
        ASSERT_EQ(halves, expected) << at;
      }
  }
}

TEST(ExrCodec, RunsOfEveryLength) {
  Unpacker unpacker;
  for (size_t run = 1; run < 400; ++run) {
    Bytes bytes;
    for (uint8_t value = 0; bytes.size() < 1200; value = uint8_t(value + 3)) bytes.insert(bytes.end(), run, value);
    bytes.resize(1200);
    const Bytes file = packed(Compression::Rle, bytes, bytes.size());
    std::vector<uint32_t> back(300);
    unpacker.unpack(Compression::Rle, file, 1200, 1200).copy(0, std::span<uint32_t>(back));
    ASSERT_EQ(std::memcmp(back.data(), bytes.data(), 1200), 0) << run;
  }
}

TEST(ExrCodec, FillsUpWhatIsStoredAsItIs) {
  const Bytes bytes = randomBytes(40, 256, 1);
  const Bytes file = packed(Compression::None, bytes, 64);
  EXPECT_EQ(file.size(), 64u);
  std::vector<uint32_t> back(10);
  Unpacker().unpack(Compression::None, file, 40, 64).copy(0, std::span<uint32_t>(back));
  EXPECT_EQ(std::memcmp(back.data(), bytes.data(), 40), 0);
}

TEST(ExrCodec, RefusesDamage) {
  Unpacker unpacker;
  const Bytes bytes = randomBytes(400, 2, 1);
  for (Compression compression : kAll) {
    const Bytes file = packed(compression, bytes, bytes.size());
    for (size_t size = 0; size < file.size(); ++size)
      EXPECT_THROW(unpacker.unpack(compression, std::span(file).first(size), 400, 400), Error) << size;
    EXPECT_THROW(unpacker.unpack(compression, file, 398, 398), Error);
    EXPECT_THROW(unpacker.unpack(compression, file, 402, 402), Error);
  }
  EXPECT_THROW(unpacker.unpack(Compression::Zips, Bytes{1, 2, 3, 4}, 400, 400), Error);
}

TEST(ExrCodec, BoundsWhatPackedBytesCanHold) {
  EXPECT_EQ(mostUnpacked(Compression::None, 10), 10u);
  // Deflate's densest code: two bits for 258 bytes.
  EXPECT_EQ(mostUnpacked(Compression::Zips, 10), 10u * 4 * 258);
  const Bytes zeros(size_t(1) << 20);
  for (Compression compression : kAll) {
    const Bytes file = packed(compression, zeros, zeros.size());
    EXPECT_GE(mostUnpacked(compression, file.size()), zeros.size());
    EXPECT_EQ(mostUnpacked(compression, ~uint64_t(0)), ~uint64_t(0));
  }
}

}  // namespace
}  // namespace fathom
