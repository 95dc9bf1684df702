// Weight files: what comes through, and what is refused with which line.
#include "nn/weights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "tests/reference/safetensors.h"
#include "tests/reference/temporary_folder.h"

namespace fathom::nn {
namespace {

using reference::Bytes;
using reference::PlainWeights;
using reference::safetensors;
using reference::withHeader;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

PlainWeights someWeights() {
  PlainWeights weights;
  weights.metadata = {{"format", "test"}, {"name", "ümlaut"}};
  weights.tensors["a.weight"] = {{2, 1, 1, 3}, {1, -2, 3, 4, 0.5f, 1e-40f}};
  weights.tensors["b"] = {{}, {7}};
  weights.tensors["c"] = {{2}, {8, 9}};
  return weights;
}

std::string refusal(const Bytes& bytes) {
  try {
    readWeights(bytes, "x.safetensors");
  } catch (const Error& e) {
    EXPECT_THAT(e.what(), StartsWith("x.safetensors"));
    EXPECT_THAT(e.what(), Not(HasSubstr("\n")));
    return e.what();
  }
  return "accepted";
}

std::string refusalOfHeader(const std::string& header, size_t dataBytes) {
  return refusal(withHeader(header, Bytes(dataBytes)));
}

// A header with one tensor, t.
std::string header(const std::string& dtype, const std::string& shape, const std::string& offsets) {
  return R"({"t":{"dtype":)" + dtype + R"(,"shape":)" + shape + R"(,"data_offsets":)" + offsets + "}}";
}

TEST(Weights, ComeThrough) {
  const WeightFile file = readWeights(safetensors(someWeights()), "x.safetensors");
  EXPECT_EQ(file.metadata, someWeights().metadata);
  ASSERT_EQ(file.tensors.size(), 3U);
  for (const auto& [name, expected] : someWeights().tensors) {
    const Tensor& tensor = file.tensors.at(name);
    EXPECT_EQ(tensor.shape, expected.shape);
    EXPECT_EQ(std::vector<float>(tensor.values.begin(), tensor.values.end()), expected.values);
  }
}

TEST(Weights, ComeFromAFile) {
  const TemporaryFolder folder;
  const Bytes bytes = safetensors(someWeights());
  const std::string path = folder / "w.safetensors";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char*>(bytes.data()), std::streamsize(bytes.size()));
  const WeightFile file = readWeights(path);
  EXPECT_EQ(file.name, path);
  EXPECT_EQ(file.tensors.at("c").values[1], 9.0f);
  EXPECT_THROW(readWeights(folder / "none.safetensors"), Error);
  EXPECT_THROW(readWeights(folder.path()), Error);
}

TEST(Weights, AreConvertedFromHalves) {
  const auto read = [](const std::string& dtype, const std::vector<uint16_t>& bits) {
    Bytes data;
    for (const uint16_t b : bits) {
      data.push_back(std::byte(b & 255));
      data.push_back(std::byte(b >> 8));
    }
    const std::string count = std::to_string(bits.size()), end = std::to_string(2 * bits.size());
    const WeightFile file =
        readWeights(withHeader(header("\"" + dtype + "\"", "[" + count + "]", "[0," + end + "]"), data), "x");
    const Buffer<float>& values = file.tensors.at("t").values;
    return std::vector<float>(values.begin(), values.end());
  };
  EXPECT_EQ(read("F16", {0x3c00, 0xc000, 0x0001, 0x03ff, 0x0400, 0x7bff, 0x8000, 0x3555}),
            (std::vector<float>{1, -2, std::ldexp(1.0f, -24), std::ldexp(1023.0f, -24), std::ldexp(1.0f, -14), 65504,
                                -0.0f, 0.333251953125f}));
  EXPECT_EQ(read("BF16", {0x3f80, 0xc000, 0x0080, 0x7f7f}),
            (std::vector<float>{1, -2, std::numeric_limits<float>::min(), std::ldexp(255.0f, 120)}));
  EXPECT_THROW(read("F16", {0x7c00}), Error);
  EXPECT_THROW(read("F16", {0x7e00}), Error);
  EXPECT_THROW(read("BF16", {0xff80}), Error);
}

TEST(Weights, AreRefusedWhenTheFileIsCutOrLongerAnywhere) {
  Bytes bytes = safetensors(someWeights());
  for (size_t size = 0; size < bytes.size(); ++size)
    EXPECT_NE(refusal(Bytes(bytes.begin(), bytes.begin() + ptrdiff_t(size))), "accepted") << size;
  bytes.push_back(std::byte(0));
  EXPECT_EQ(refusal(bytes), "x.safetensors: expected 36 bytes of tensors, found 37");
}

TEST(Weights, AreRefusedWhenBytesAreWrong) {
  // Any byte changed: an answer or one line, and never anything else.
  const Bytes bytes = safetensors(someWeights());
  for (size_t i = 0; i < bytes.size(); ++i)
    for (const int value : {0x00, 0x22, 0x39, 0x7b, 0x7f, 0x80, 0xff}) {
      Bytes changed = bytes;
      changed[i] = std::byte(value);
      refusal(changed);
    }
}

TEST(Weights, HeadersAreRefused) {
  Bytes huge(64);
  huge[7] = std::byte(0x80);
  EXPECT_EQ(refusal(huge),
            "x.safetensors: expected a safetensors header of at most 1048576 bytes, found 9223372036854775808");
  EXPECT_EQ(refusal({}), "x.safetensors: expected a safetensors file of at least 8 bytes, found 0");
  EXPECT_THAT(refusalOfHeader("{", 0), HasSubstr("the header is no JSON"));
  EXPECT_THAT(refusalOfHeader("", 0), HasSubstr("the header is no JSON"));
  EXPECT_THAT(refusalOfHeader("{\"a\xff\":1}", 0), HasSubstr("the header is no JSON"));
  EXPECT_EQ(refusalOfHeader("[]", 0), "x.safetensors: expected a JSON object as the header, found array");
  EXPECT_EQ(refusalOfHeader(R"({"t":7})", 0), "x.safetensors, tensor t: expected an object, found number");
  EXPECT_THAT(refusalOfHeader(std::string(100000, '['), 0), HasSubstr("nested deeper"));
  EXPECT_THAT(refusalOfHeader(R"({"":{"dtype":"F32","shape":[1],"data_offsets":[0,4]}})", 4),
              HasSubstr("names of 1 to"));
  EXPECT_EQ(refusalOfHeader(R"({"__metadata__":7})", 0),
            "x.safetensors: expected strings as __metadata__, found number");
  EXPECT_EQ(refusalOfHeader(R"({"__metadata__":{"steps":7}})", 0),
            "x.safetensors: expected a string as metadata steps, found number");
  EXPECT_EQ(refusalOfHeader("{}", 0), "accepted");
}

TEST(Weights, NamesThatComeTwiceAreRefused) {
  const std::string t = R"("t":{"dtype":"F32","shape":[1],"data_offsets":[0,4]})";
  EXPECT_EQ(refusalOfHeader("{" + t + "," + t + "}", 4), "x.safetensors: the header has the name t twice");
  EXPECT_EQ(refusalOfHeader(R"({"t":{"dtype":"F32","shape":[1],"shape":[1],"data_offsets":[0,4]}})", 4),
            "x.safetensors: the header has the name shape twice");
  EXPECT_EQ(refusalOfHeader("{" + t + "}", 4), "accepted");
}

TEST(Weights, EntriesAreRefused) {
  const std::string where = "x.safetensors, tensor t: ";
  EXPECT_EQ(refusalOfHeader(header("\"F64\"", "[1]", "[0,8]"), 8),
            where + "expected dtype F32, F16 or BF16, found F64");
  EXPECT_EQ(refusalOfHeader(header("32", "[1]", "[0,4]"), 4), where + "expected dtype F32, F16 or BF16, found 32");
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[-1]", "[0,4]"), 4),
            where + "expected whole numbers of at least 0 as the shape, found -1");
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[1.5]", "[0,4]"), 4),
            where + "expected whole numbers of at least 0 as the shape, found 1.5");
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[0]", "[0,0]"), 0), where + "the shape [0] has nothing in it");
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[4294967296,4294967296]", "[0,0]"), 0),
            where + "the shape [4294967296,4294967296] is larger than any file");
  EXPECT_THAT(refusalOfHeader(header("\"F32\"", "[65536,65536,65536,65536]", "[0,0]"), 0),
              HasSubstr("larger than any"));
  EXPECT_THAT(refusalOfHeader(header("\"F32\"", "[1,1,1,1,1,1,1,1,1]", "[0,4]"), 4), HasSubstr("at most 8 numbers"));
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[2,3]", "[0,20]"), 20),
            where + "expected 24 bytes for shape 2x3, found data_offsets [0,20]");
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[1]", "[4,0]"), 4),
            where + "expected 4 bytes for shape 1, found data_offsets [4,0]");
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "[1]", "[18446744073709551615,3]"), 4),
            where + "expected 4 bytes for shape 1, found data_offsets [18446744073709551615,3]");
  EXPECT_THAT(refusalOfHeader(header("\"F32\"", "[1]", "[0,4,8]"), 4), HasSubstr("expected two numbers"));
  EXPECT_EQ(refusalOfHeader(R"({"t":{"dtype":"F32","shape":[1]}})", 4), where + "data_offsets is missing");
  EXPECT_EQ(refusalOfHeader(R"({"t":{"dtype":"F32","shape":[1],"data_offsets":[0,4],"x":1}})", 4),
            where + "expected dtype, shape and data_offsets, found x");
}

TEST(Weights, RangesAreRefused) {
  const auto two = [](const std::string& a, const std::string& b, size_t bytes) {
    return refusalOfHeader(R"({"a":{"dtype":"F32","shape":[2],"data_offsets":)" + a +
                               R"(},"b":{"dtype":"F32","shape":[1],"data_offsets":)" + b + "}}",
                           bytes);
  };
  EXPECT_EQ(two("[0,8]", "[8,12]", 12), "accepted");
  EXPECT_EQ(two("[4,12]", "[0,4]", 12), "accepted");
  EXPECT_EQ(two("[0,8]", "[4,8]", 12),
            "x.safetensors, tensor b: expected data from byte 8 on, found 4 (two tensors overlap)");
  EXPECT_EQ(two("[0,8]", "[9,13]", 13),
            "x.safetensors, tensor b: expected data from byte 8 on, found 9 (bytes that belong to no tensor)");
  EXPECT_EQ(two("[0,8]", "[8,12]", 11),
            "x.safetensors, tensor b: expected data within 11 bytes, found it to end at 12");
  EXPECT_EQ(two("[0,8]", "[8,12]", 16), "x.safetensors: expected 12 bytes of tensors, found 16");
}

TEST(Weights, MayHaveSoManyTensorsAndNamesSoLong) {
  const auto tensors = [](size_t count) {
    PlainWeights weights;
    for (size_t i = 0; i < count; ++i) weights.tensors[std::to_string(i)] = {{1}, {1}};
    return weights;
  };
  PlainWeights most = tensors(4096);
  EXPECT_EQ(refusal(safetensors(most)), "accepted");
  most.metadata = {{"format", "test"}};
  EXPECT_EQ(refusal(safetensors(most)), "accepted");
  EXPECT_EQ(refusal(safetensors(tensors(4097))), "x.safetensors: expected at most 4096 tensors, found 4097");

  PlainWeights named;
  named.tensors[std::string(256, 'n')] = {{1}, {1}};
  EXPECT_EQ(refusal(safetensors(named)), "accepted");
  named.tensors[std::string(257, 'n')] = {{1}, {1}};
  EXPECT_EQ(refusal(safetensors(named)), "x.safetensors: expected tensor names of 1 to 256 bytes, found one of 257");
}

TEST(Weights, HalvesThatAreNotFiniteAreNamed) {
  const auto of = [](int high) {
    return refusal(
        withHeader(header("\"F16\"", "[2]", "[0,4]"), {std::byte(0), std::byte(0), std::byte(0), std::byte(high)}));
  };
  const std::string expected = "x.safetensors, tensor t: expected finite numbers, found ";
  EXPECT_EQ(of(0x7c), expected + "inf at index 1");
  EXPECT_EQ(of(0xfc), expected + "-inf at index 1");
  EXPECT_EQ(of(0x7e), expected + "nan at index 1");
}

TEST(Weights, FilesOfAnyLengthAreNotRead) {
  const TemporaryFolder folder;
  const std::string path = folder / "w.safetensors";
  std::ofstream(path, std::ios::binary) << "x";
  std::filesystem::resize_file(path, (uint64_t(1) << 30) + (1 << 20) + 9);  // nothing of it is on the disk
  try {
    readWeights(path);
    FAIL();
  } catch (const Error& e) {
    EXPECT_EQ(std::string(e.what()), path + ": expected a weight file of at most 1074790408 bytes, found 1074790409");
  }
}

TEST(Weights, LongTextsAreCutInErrors) {
  const std::string where = "x.safetensors, tensor t: ", digits(100, '7');
  EXPECT_EQ(refusalOfHeader(header("\"" + digits + "\"", "[1]", "[0,4]"), 4),
            where + "expected dtype F32, F16 or BF16, found " + digits.substr(0, 60));
  EXPECT_EQ(refusalOfHeader(header("\"F32\"", "\"" + digits + "\"", "[0,4]"), 4),
            where + "expected a shape of at most 8 numbers, found \"" + digits.substr(0, 56) + "...");
}

TEST(Weights, MustBeFinite) {
  for (const float v : {std::numeric_limits<float>::quiet_NaN(), -std::numeric_limits<float>::infinity()}) {
    PlainWeights weights = someWeights();
    weights.tensors["c"].values[1] = v;
    EXPECT_THAT(refusal(safetensors(weights)), StartsWith("x.safetensors, tensor c: expected finite numbers, found"));
  }
}

TEST(Weights, AreTakenByName) {
  const WeightFile file = readWeights(safetensors(someWeights()), "x");
  WeightSource source(file);
  EXPECT_EQ(source.take("c", {2}).values[0], 8.0f);
  const auto message = [](const auto& call) {
    try {
      call();
    } catch (const Error& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  EXPECT_EQ(message([&] { source.take("d", {2}); }), "x: tensor d is missing");
  EXPECT_EQ(message([&] { source.take("b", {1}); }), "x, tensor b: expected shape 1, found scalar");
  EXPECT_EQ(message([&] { source.take("a.weight", {2, 3}); }), "x, tensor a.weight: expected shape 2x3, found 2x1x1x3");
  EXPECT_EQ(message([&] { source.finish(); }), "x, tensor a.weight: no layer takes it");
  source.take("a.weight", {2, 1, 1, 3});
  source.take("b", {});
  EXPECT_EQ(message([&] { source.finish(); }), "");
}

}  // namespace
}  // namespace fathom::nn
