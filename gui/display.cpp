#include "gui/display.h"

#include <OpenColorIO/OpenColorIO.h>

#include <QFile>
#include <algorithm>
#include <sstream>

#include "flat/error.h"

namespace ocio = OCIO_NAMESPACE;

// A linker leaves the resources of a library out unless they are asked for, from outside of any namespace.
static void bringResources() {
  Q_INIT_RESOURCE(fathom);
}

namespace fathom::gui {

namespace {

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

RowTransform makeRows(const ocio::ConstConfigRcPtr& config, const ocio::GroupTransformRcPtr& group) {
  const ocio::ConstCPUProcessorRcPtr processor = config->getProcessor(group)->getOptimizedCPUProcessor(
      ocio::BIT_DEPTH_F32, ocio::BIT_DEPTH_UINT8, ocio::OPTIMIZATION_DEFAULT);
  return [processor](const float* rgba, int pixels, QRgb* to) {
    // The library takes what it only reads by a pointer to what can change.
    const ocio::PackedImageDesc from(const_cast<float*>(rgba), pixels, 1, ocio::CHANNEL_ORDERING_RGBA,
                                     ocio::BIT_DEPTH_F32, ocio::AutoStride, ocio::AutoStride, ocio::AutoStride);
    ocio::PackedImageDesc into(to, pixels, 1, ocio::CHANNEL_ORDERING_BGRA, ocio::BIT_DEPTH_UINT8, ocio::AutoStride,
                               ocio::AutoStride, ocio::AutoStride);
    processor->apply(from, into);
    for (int i = 0; i < pixels; ++i) to[i] |= 0xff000000u;
  };
}

}  // namespace

struct Display::Config {
  ocio::ConstConfigRcPtr ocio;
};

Display::Display(const std::string& path) : path_(path) {
  ocio::SetLoggingFunction([](const char*) {});  // warnings would go to the terminal
  config_ = std::make_unique<Config>(Config{loadConfig(path)});
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

RowTransform Display::transform(const DisplayParams& params) const {
  const std::string display = oneOf(displays(), params.display), view = oneOf(views(display), params.view);
  const std::vector<std::string> offered = looks();
  const bool withLook = std::ranges::find(offered, params.look) != offered.end();
  try {
    const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
    if (withLook) {
      const ocio::LookTransformRcPtr look = ocio::LookTransform::Create();
      look->setSrc(ocio::ROLE_SCENE_LINEAR);
      look->setDst(ocio::ROLE_SCENE_LINEAR);
      look->setLooks(params.look.c_str());
      group->appendTransform(look);
    }
    const ocio::DisplayViewTransformRcPtr show = ocio::DisplayViewTransform::Create();
    show->setSrc(ocio::ROLE_SCENE_LINEAR);
    show->setDisplay(display.c_str());
    show->setView(view.c_str());
    show->setLooksBypass(withLook);
    group->appendTransform(show);
    addGamma(group, params.gamma);
    return makeRows(config_->ocio, group);
  } catch (const ocio::Exception& e) {
    fail("{}: display {}, view {}: {}", path_.empty() ? "built-in colour config" : path_, display, view,
         oneLine(e.what()));
  }
}

RowTransform Display::plainTransform(float gamma) const {
  const ocio::GroupTransformRcPtr group = ocio::GroupTransform::Create();
  addGamma(group, gamma);
  return makeRows(ocio::Config::CreateRaw(), group);
}

}  // namespace fathom::gui
