// The attributes of an EXR part, kept whole: whatever a file has is carried through, typed access to what Fathom reads.
#pragma once

#include <OpenEXR/ImfForward.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace fathom::deep {

// Removes an attribute where there is one. (Imf::Header::erase of OpenEXR 3.1 takes it out without freeing it.)
void eraseAttribute(Imf::Header& header, std::string_view name);

class Attributes {
 public:
  Attributes();
  explicit Attributes(const Imf::Header& header);
  Attributes(const Attributes& other);
  Attributes(Attributes&& other) noexcept;
  Attributes& operator=(const Attributes& other);
  Attributes& operator=(Attributes&& other) noexcept;
  ~Attributes();

  // Nothing where the attribute is absent or of another type (an int is accepted where a float is asked for).
  std::optional<int> getInt(std::string_view name) const;
  std::optional<float> getFloat(std::string_view name) const;
  std::optional<std::string> getString(std::string_view name) const;
  std::optional<std::array<float, 16>> getMatrix(std::string_view name) const;  // row vectors, as Imath stores it

  void set(std::string_view name, int value);
  void set(std::string_view name, float value);
  void set(std::string_view name, const std::string& value);
  void set(std::string_view name, const std::array<float, 16>& value);
  void erase(std::string_view name);

  // Windows, channels, compression, tiles and type in here are stale: deep/io overwrites them when it writes.
  const Imf::Header& header() const { return *header_; }

 private:
  std::unique_ptr<Imf::Header> header_;
};

}  // namespace fathom::deep
