#include "gui/display.h"

#include <OpenColorIO/OpenColorIO.h>

#include <QFile>
#include <algorithm>
#include <list>
#include <mutex>
#include <optional>
#include <sstream>

#include "base/error.h"
#include "flat/curve_table.h"

namespace ocio = OCIO_NAMESPACE;

// A linker leaves the resources of a library out unless they are asked for, from outside of any namespace.
static void bringResources() {
  Q_INIT_RESOURCE(fathom);
}

namespace fathom::gui {

namespace {

constexpr uint32_t kOpaque = 0xff000000u;
// Of a table, in the middle of its lines and so half of what it may be off by elsewhere; 1 is white.
constexpr float kTolerance = 0.2f / 255;
constexpr size_t kMostKept = 16;  // transforms, of 200 KB and more each

ocio::ConstConfigRcPtr loadConfig(const std::string& path) {
  try {
    ocio::ConstConfigRcPtr config;
    if (path.empty()) {
      bringResources();
      QFile file(":/config.ocio");
      if (!file.open(QIODevice::ReadOnly)) fail("the built-in colour config is missing");
      std::istringstream text(file.readAll().toStdString());
      config = ocio::Config::CreateFromStream(text);
    } else {
      config = ocio::Config::CreateFromFile(path.c_str());
    }
    config->validate();
    return config;
  } catch (const ocio::Exception& e) {
    fail("{}: {}", path.empty() ? "built-in colour config" : path, oneLine(e.what()));
  }
}

// `wanted` where it is offered, or else the first.
std::string oneOf(const std::vector<std::string>& offered, const std::string& wanted) {
  if (std::ranges::find(offered, wanted) != offered.end()) return wanted;
  return offered.empty() ? "" : offered.front();
}

std::vector<std::string> withFirst(std::vector<std::string> names, const std::string& first) {
  const auto found = std::ranges::find(names, first);
  if (found != names.end()) std::rotate(names.begin(), found, found + 1);
  return names;
}

// Appends value^(1/gamma), nothing below 0.
void addGamma(const ocio::GroupTransformRcPtr& group, float gamma) {
  if (gamma == 1 || !(gamma > 0)) return;
  const double power = 1 / double(gamma);
  const ocio::ExponentTransformRcPtr exponent = ocio::ExponentTransform::Create();
  exponent->setValue({power, power, power, 1});
  exponent->setNegativeStyle(ocio::NEGATIVE_CLAMP);
  group->appendTransform(exponent);
}

// The library takes what it only reads by a pointer to what can change.
ocio::PackedImageDesc describe(const void* pixels, int count, ocio::ChannelOrdering order, ocio::BitDepth depth) {
  return {const_cast<void*>(pixels), count, 1, order, depth, ocio::AutoStride, ocio::AutoStride, ocio::AutoStride};
}

RowTransform exact(const ocio::ConstProcessorRcPtr& processor) {
  const ocio::ConstCPUProcessorRcPtr cpu =
      processor->getOptimizedCPUProcessor(ocio::BIT_DEPTH_F32, ocio::BIT_DEPTH_UINT8, ocio::OPTIMIZATION_DEFAULT);
  return [cpu](const std::array<const float*, 3>& rgb, int pixels, QRgb* to) {
    thread_local std::vector<float> rgba;
    rgba.resize(4 * size_t(pixels));
    for (size_t x = 0; x < size_t(pixels); ++x) {
      for (size_t c = 0; c < 3; ++c) rgba[4 * x + c] = rgb[c][x];
      rgba[4 * x + 3] = 1;
    }
    const auto from = describe(rgba.data(), pixels, ocio::CHANNEL_ORDERING_RGBA, ocio::BIT_DEPTH_F32);
    auto into = describe(to, pixels, ocio::CHANNEL_ORDERING_BGRA, ocio::BIT_DEPTH_UINT8);
    cpu->apply(from, into);
    for (int i = 0; i < pixels; ++i) to[i] |= kOpaque;
  };
}

// A table for each channel, channels that are treated alike with the same one; none where channels mix, or where a table
// would be too far off.
using Tables = std::array<std::shared_ptr<const flat::CurveTable>, 3>;
std::optional<Tables> makeTables(const ocio::ConstProcessorRcPtr& processor) {
  if (processor->hasChannelCrosstalk()) return {};
  const ocio::ConstCPUProcessorRcPtr cpu =
      processor->getOptimizedCPUProcessor(ocio::BIT_DEPTH_F32, ocio::BIT_DEPTH_F32, ocio::OPTIMIZATION_DEFAULT);
  std::vector<float> rgba;  // all of it, from the first channel on
  Tables tables;
  for (size_t c = 0; c < 3; ++c) {
    const auto evaluate = [&](std::span<float> values) {
      if (rgba.empty()) {
        rgba.assign(4 * values.size(), 1.0f);
        for (size_t i = 0; i < values.size(); ++i) std::fill_n(&rgba[4 * i], 3, values[i]);
        auto image = describe(rgba.data(), int(values.size()), ocio::CHANNEL_ORDERING_RGBA, ocio::BIT_DEPTH_F32);
        cpu->apply(image);
      }
      for (size_t i = 0; i < values.size(); ++i) values[i] = rgba[4 * i + c];
    };
    std::optional<flat::CurveTable> made = flat::CurveTable::make(evaluate, kTolerance);
    if (!made) return {};
    const bool alike = c > 0 && std::ranges::equal(made->values(), tables[0]->values());
    tables[c] = alike ? tables[0] : std::make_shared<const flat::CurveTable>(*std::move(made));
  }
  return tables;
}

RowTransform tabulated(const ocio::ConstProcessorRcPtr& processor) {
  const std::optional<Tables> tables = makeTables(processor);
  if (!tables) return exact(processor);
  return [all = *tables](const std::array<const float*, 3>& rgb, int pixels, QRgb* to) {
    flat::lookUpPixels({all[0].get(), all[1].get(), all[2].get()}, rgb, size_t(pixels), to);
  };
}

}  // namespace

struct Display::Config {
  struct Kept {
    std::string name;
    RowTransform rows;
  };
  ocio::ConstConfigRcPtr ocio;
  std::mutex mutex = {};      // of:
  std::list<Kept> kept = {};  // the last used first

  // What goes by that name, or what `make` makes.
  template <class Make>
  RowTransform keep(const std::string& name, const Make& make) {
    const std::scoped_lock lock(mutex);
    const auto found = std::ranges::find(kept, name, &Kept::name);
    if (found == kept.end())
      kept.push_front({name, make()});
    else
      kept.splice(kept.begin(), kept, found);
    if (kept.size() > kMostKept) kept.pop_back();
    return kept.front().rows;
  }

  ocio::ConstProcessorRcPtr processor(const std::string& display, const std::string& view, const std::string& look,
                                      float gamma) const {
    const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
    if (!look.empty()) {
      const ocio::LookTransformRcPtr transform = ocio::LookTransform::Create();
      transform->setSrc(ocio::ROLE_SCENE_LINEAR);
      transform->setDst(ocio::ROLE_SCENE_LINEAR);
      transform->setLooks(look.c_str());
      group->appendTransform(transform);
    }
    const ocio::DisplayViewTransformRcPtr show = ocio::DisplayViewTransform::Create();
    show->setSrc(ocio::ROLE_SCENE_LINEAR);
    show->setDisplay(display.c_str());
    show->setView(view.c_str());
    show->setLooksBypass(!look.empty());
    group->appendTransform(show);
    addGamma(group, gamma);
    return ocio->getProcessor(group);
  }
};

Display::Display(const std::string& path) : path_(path) {
  ocio::SetLoggingFunction([](const char*) {});  // warnings would go to the terminal
  config_ = std::make_unique<Config>();
  config_->ocio = loadConfig(path);
}

Display::~Display() = default;

std::shared_ptr<const Display> Display::open(std::string& problem) {
  if (const std::string path = qEnvironmentVariable("OCIO").toStdString(); !path.empty()) try {
      return std::make_shared<Display>(path);
    } catch (const Error& e) {
      problem = e.what();
    }
  return std::make_shared<Display>();
}

std::vector<std::string> Display::displays() const {
  std::vector<std::string> names;
  for (int i = 0; i < config_->ocio->getNumDisplays(); ++i) names.emplace_back(config_->ocio->getDisplay(i));
  return withFirst(std::move(names), config_->ocio->getDefaultDisplay());
}

std::vector<std::string> Display::views(const std::string& display) const {
  const std::string of = oneOf(displays(), display);
  std::vector<std::string> names;
  for (int i = 0; i < config_->ocio->getNumViews(of.c_str()); ++i)
    names.emplace_back(config_->ocio->getView(of.c_str(), i));
  return withFirst(std::move(names), config_->ocio->getDefaultView(of.c_str()));
}

std::vector<std::string> Display::looks() const {
  std::vector<std::string> names;
  for (int i = 0; i < config_->ocio->getNumLooks(); ++i) names.emplace_back(config_->ocio->getLookNameByIndex(i));
  return names;
}

RowTransform Display::transform(const DisplayParams& params, bool exactly) const {
  const std::string display = oneOf(displays(), params.display), view = oneOf(views(display), params.view);
  const std::vector<std::string> offered = looks();
  const std::string look = std::ranges::find(offered, params.look) != offered.end() ? params.look : "";
  const auto make = [&] {
    const ocio::ConstProcessorRcPtr processor = config_->processor(display, view, look, params.gamma);
    return exactly ? exact(processor) : tabulated(processor);
  };
  try {
    return config_->keep(fmt::format("{}\n{}\n{}\n{}\n{}", display, view, look, params.gamma, exactly), make);
  } catch (const ocio::Exception& e) {
    fail("{}: display {}, view {}: {}", path_.empty() ? "built-in colour config" : path_, display, view,
         oneLine(e.what()));
  }
}

RowTransform Display::plainTransform(float gamma) const {
  return config_->keep(fmt::format("{}", gamma), [&] {
    const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
    addGamma(group, gamma);
    return tabulated(ocio::Config::CreateRaw()->getProcessor(group));
  });
}

}  // namespace fathom::gui
