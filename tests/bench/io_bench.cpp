// Reading and writing deep files against OpenEXR's own reader and writer on as many threads.
#include <OpenEXR/ImfDeepScanLineOutputFile.h>
#include <OpenEXR/ImfThreading.h>
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <filesystem>

#include "deep/io.h"
#include "tests/bench/frames.h"
#include "tests/bench/measure.h"
#include "tests/reference/openexr_deep.h"

namespace fathom::bench {
namespace {

using deep::DeepImage;
using deep::PixelType;

constexpr int kWidth = 1280, kHeight = 800, kRepeats = 5;

bool isBeauty(const std::string& name) {
  return name == "R" || name == "G" || name == "B" || name == "A" || name == "Z";
}

void writeWithOpenExr(const std::string& path, DeepImage& image) {
  Imf::Header header(kWidth, kHeight);
  header.setType(Imf::DEEPSCANLINE);
  header.compression() = Imf::ZIPS_COMPRESSION;
  for (const deep::Channel& c : image.channels)
    header.channels().insert(c.name, Imf::Channel(reference::planeType(c.type)));
  Imf::DeepScanLineOutputFile file(path.c_str(), header);
  reference::Pointers pointers;
  file.setFrameBuffer(reference::frameBuffer(image, pointers));
  file.writePixels(kHeight);
}

Table measure(const std::string& source, const std::string& folder) {
  DeepImage image = tiled(deep::read(source), kWidth, kHeight);
  for (deep::Channel& c : image.channels)
    if (c.type == PixelType::Half)
      c.type = PixelType::Float;  // OpenEXR's writer takes no others from a plane of floats
  const std::string path = folder + "/io.exr", theirs = folder + "/io-openexr.exr";
  deep::ReadOptions few;
  few.channels = isBeauty;
  const double mega = double(image.pixels()) / 1e6,
               megabytes = 4e-6 * double(image.samples()) * double(image.channels.size());

  const std::vector<double> seconds =
      interleavedMedians({[&] { deep::write(path, image); }, [&] { writeWithOpenExr(theirs, image); },
                          [&] { deep::read(path); }, [&] { reference::readWithOpenExr(path); },
                          [&] { deep::read(path, few); }, [&] { reference::readWithOpenExr(path, 0, isBeauty); }},
                         kRepeats);
  const size_t peak = peakGrowth([&] { deep::read(path); });

  Table table(fmt::format("Deep files, {:.2f} megapixels, {} samples, {} channels, {:.0f} MB decoded, {} threads", mega,
                          image.samples(), image.channels.size(), megabytes, tbb::this_task_arena::max_concurrency()),
              {"what", "Fathom s/MP", "OpenEXR s/MP", "Fathom MB/s"});
  const char* names[] = {"write, zips", "read all channels", "read R G B A Z"};
  for (size_t i = 0; i < std::size(names); ++i)
    table.add({std::string(names[i]), seconds[2 * i] / mega, seconds[2 * i + 1] / mega, megabytes / seconds[2 * i]});
  table.add({std::string("size of the file, MB"), double(std::filesystem::file_size(path)) / 1e6,
             double(std::filesystem::file_size(theirs)) / 1e6, std::string()});
  table.add({std::string("peak memory of reading, MB"), double(peak) / 1e6, std::string(), std::string()});
  std::filesystem::remove(path);
  std::filesystem::remove(theirs);
  return table;
}

}  // namespace
}  // namespace fathom::bench

int main(int argc, char** argv) {
  if (argc != 3) return fmt::print(stderr, "usage: bench_io DEMO_FOLDER OUTPUT_FOLDER\n"), 2;
  using namespace fathom::bench;
  Imf::setGlobalThreadCount(tbb::this_task_arena::max_concurrency());
  const std::vector<Table> tables = {measure(std::string(argv[1]) + "/sequence.0001.deep.exr", argv[2])};
  for (const Table& table : tables) table.print();
  writeJson(std::string(argv[2]) + "/io.json", tables);
}
