#include "deep/attributes.h"

#include <OpenEXR/ImfFloatAttribute.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIntAttribute.h>
#include <OpenEXR/ImfMatrixAttribute.h>
#include <OpenEXR/ImfStringAttribute.h>

#include <algorithm>

namespace fathom::deep {

namespace {

template <class Attribute>
const Attribute* find(const Imf::Header& header, std::string_view name) {
  return header.findTypedAttribute<Attribute>(std::string(name));
}

// Header::insert refuses to change the type of an attribute that is there.
template <class Attribute>
void replace(Imf::Header& header, std::string_view name, const Attribute& attribute) {
  eraseAttribute(header, name);
  header.insert(std::string(name), attribute);
}

}  // namespace

void eraseAttribute(Imf::Header& header, std::string_view name) {
  if (header.find(std::string(name)) == header.end()) return;
  Imf::Header others;
  for (auto it = header.begin(); it != header.end(); ++it)
    if (it.name() != name) others.insert(it.name(), it.attribute());
  header = others;
}

Attributes::Attributes() : header_(std::make_unique<Imf::Header>()) {}
Attributes::Attributes(const Imf::Header& header) : header_(std::make_unique<Imf::Header>(header)) {}
Attributes::Attributes(const Attributes& other) : Attributes(*other.header_) {}
Attributes::Attributes(Attributes&& other) noexcept = default;
Attributes& Attributes::operator=(const Attributes& other) {
  if (this != &other) header_ = std::make_unique<Imf::Header>(*other.header_);
  return *this;
}
Attributes& Attributes::operator=(Attributes&& other) noexcept = default;
Attributes::~Attributes() = default;

std::optional<int> Attributes::getInt(std::string_view name) const {
  if (const auto* a = find<Imf::IntAttribute>(*header_, name)) return a->value();
  return {};
}

std::optional<float> Attributes::getFloat(std::string_view name) const {
  if (const auto* a = find<Imf::FloatAttribute>(*header_, name)) return a->value();
  if (const auto value = getInt(name)) return float(*value);
  return {};
}

std::optional<std::string> Attributes::getString(std::string_view name) const {
  if (const auto* a = find<Imf::StringAttribute>(*header_, name)) return a->value();
  return {};
}

std::optional<std::array<float, 16>> Attributes::getMatrix(std::string_view name) const {
  const auto* a = find<Imf::M44fAttribute>(*header_, name);
  if (!a) return {};
  std::array<float, 16> result;
  std::copy_n(a->value().getValue(), 16, result.begin());
  return result;
}

void Attributes::set(std::string_view name, int value) {
  replace(*header_, name, Imf::IntAttribute(value));
}
void Attributes::set(std::string_view name, float value) {
  replace(*header_, name, Imf::FloatAttribute(value));
}
void Attributes::set(std::string_view name, const std::string& value) {
  replace(*header_, name, Imf::StringAttribute(value));
}
void Attributes::set(std::string_view name, const std::array<float, 16>& value) {
  Imath::M44f matrix;
  std::copy(value.begin(), value.end(), matrix.getValue());
  replace(*header_, name, Imf::M44fAttribute(matrix));
}
void Attributes::erase(std::string_view name) {
  eraseAttribute(*header_, name);
}

}  // namespace fathom::deep
